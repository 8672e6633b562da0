"""The keys under which daemons tell of themselves, and for which UAVs each may speak. Pure."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from ual import discovery

ROOT = "ual"
SITE_PATTERN = r"[A-Za-z0-9_][A-Za-z0-9_-]{0,63}"
_ALIVE, _TELEMETRY = "alive", "telemetry"
_NAME = r"[A-Za-z_][A-Za-z0-9_]{0,63}"
_PUBLISHER = rf"{_NAME}(?:-[0-9]{{1,9}})?"
_KEY = re.compile(rf"{ROOT}/({SITE_PATTERN})/({_PUBLISHER})/([0-9a-f]{{16}})/({_ALIVE}|{_TELEMETRY})")
_SPAN = re.compile(r"(.+)_([1-9][0-9]*|0)-([1-9][0-9]*|0)")


@dataclass(frozen=True, slots=True)
class Source:
    """One process that tells: its site, the publisher (for which UAVs it may speak), and which process it is."""

    site: str
    publisher: str
    instance: str

    @property
    def alive(self) -> str:
        """The key of its liveliness token."""
        return f"{ROOT}/{self.site}/{self.publisher}/{self.instance}/{_ALIVE}"

    @property
    def telemetry(self) -> str:
        """The key of its reports."""
        return f"{ROOT}/{self.site}/{self.publisher}/{self.instance}/{_TELEMETRY}"


def source_of(key: str) -> Source | None:
    """Returns the process that a key belongs to; None where it is no key of ours."""
    match = _KEY.fullmatch(key)
    return None if match is None else Source(match[1], match[2], match[3])


def all_alive(site: str, publisher: str = "*") -> str:
    """Returns the key expression of all liveliness tokens of a site, or of one publisher."""
    return f"{ROOT}/{site}/{publisher}/*/{_ALIVE}"


def all_telemetry(site: str) -> str:
    """Returns the key expression of all reports of a site."""
    return f"{ROOT}/{site}/*/*/{_TELEMETRY}"


def all_of(site: str, publisher: str = "") -> str:
    """Returns the key expression of all that a publisher may tell at a site, or of all publishers."""
    return f"{ROOT}/{site}/{publisher}/**" if publisher else f"{ROOT}/{site}/**"


def publisher(names: Sequence[str]) -> str:
    """Returns the publisher that speaks for these UAVs: ``uav_7``, or ``uav_1-200`` for names that are counted on."""
    if len(names) == 1:
        return names[0]
    (base, first), (_, last) = discovery.split_number(names[0]), discovery.split_number(names[-1])
    return f"{base}_{first}-{last}"


def is_publisher(text: str) -> bool:
    """Returns whether a text can be the name of a publisher."""
    return re.fullmatch(_PUBLISHER, text) is not None


def speaks_for(publisher: str, ns: str) -> bool:
    """Returns whether a publisher may speak for a UAV."""
    span = _SPAN.fullmatch(publisher)
    if span is None:
        return publisher == ns
    base, number = discovery.split_number(ns)
    return (
        number is not None
        and ns == f"{span[1]}_{number}"
        and base == span[1]
        and int(span[2]) <= number <= int(span[3])
    )
