"""Many UAVs in one daemon (``--fleet``): their names, addresses and places, and what the process needs for them."""

from __future__ import annotations

import resource
from collections.abc import Sequence

from msgspec import structs

from ual import _discovery
from ual.geometry import Vector3
from ual_daemon.settings import LONGEST_NAMESPACE, ConfigError, VehicleSettings

ROW = 10
"""How many UAVs stand in a row, eastwards; the next row is to the north of it."""

_FILES_EACH = 2
"""File descriptors of a UAV that nobody talks to: its lock, and each of its addresses (one more for each after it)."""
_FILES_BESIDE = 64
_FILES_FOR_CALLERS = 4


def names(first: str, count: int) -> list[str]:
    """The namespaces of a fleet: counted on from one that ends in ``_N``, else from ``_1``. Raises `ConfigError`."""
    base, number = _discovery.split_number(first)
    begin = 1 if number is None else number
    if len(f"{base}_{begin + count}") > LONGEST_NAMESPACE:
        raise ConfigError(f"{first}: the names of a fleet of {count} are longer than {LONGEST_NAMESPACE}", "ns")
    return [f"{base}_{begin + i}" for i in range(count)]


def places(count: int, spacing_m: float) -> list[Vector3]:
    """Where the UAVs stand from the first one: in rows of `ROW`, so that each has its place however many there are."""
    return [Vector3(i % ROW * spacing_m, i // ROW * spacing_m, 0.0) for i in range(count)]


def placed(settings: VehicleSettings, place: Vector3) -> VehicleSettings:
    """The settings of the UAV that stands at a place of the fleet, where those given are the first one's."""
    x, y, z = settings.home_pose
    return structs.replace(settings, home_pose=(x + place.x, y + place.y, z + place.z))


def addresses(templates: Sequence[str], ns: str) -> list[str]:
    """The addresses of one UAV: ``{ns}`` stands for its namespace, ``{port}`` for its port, 50050 + N.

    Raises `ConfigError` for one that all UAVs would share, and where the ports end.
    """
    found = []
    for template in templates:
        if "{ns}" not in template and "{port}" not in template and not template.endswith(":0"):
            raise ConfigError(
                f"{template}: each UAV of a fleet needs an address of its own: "
                "HOST:{port} for port 50050 + N, or unix:DIRECTORY/{ns}.sock",
                "listen",
            )
        if "{port}" in template and not _discovery.has_own_port(ns):
            raise ConfigError(f"{ns} has no port: 50050 + N ends at 65535; use unix sockets for so many", "fleet")
        found.append(template.replace("{ns}", ns).replace("{port}", str(_discovery.default_port(ns))))
    return found


def allow_files(count: int, listening: int) -> None:
    """Lets the process open as many files as a fleet needs. Raises `ConfigError` where it may not."""
    least = _FILES_BESIDE + count * (_FILES_EACH + listening - 1)
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard < least:
        raise ConfigError(
            f"{count} UAVs need {least} open files, and this process may have {hard}: raise it "
            "(ulimit -Hn, LimitNOFILE= of systemd)",
            "fleet",
        )
    wanted = least + count * _FILES_FOR_CALLERS
    if hard != resource.RLIM_INFINITY:
        wanted = min(wanted, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
