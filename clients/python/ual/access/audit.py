"""The chain of an audit: each line carries a hash of itself and of the hash of the line before.

A line that is changed, removed, added or swapped breaks the chain there. A program that can write the file could
compute all hashes again, and lines cut off at the end leave a shorter chain that is whole. For both, compare the last
hash with one that was kept elsewhere (the daemon logs it).
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

START = "0" * 64
"""Value to which the first line is chained."""
OPENED = "opened"
"""The event of the line with which a daemon begins to write."""
TORN = "torn_sha256"
"""The field of such a line that has the hash of the incomplete line before it, which a killed daemon has left."""
LOST = "lost"
"""The event of a line that says how many lines are missing before it, in the field `lines`."""
UNTOLD = "untold"
"""The event of a line in place of one that could not be made, or the field of a line without its request and answer."""
RESUMED = "resumed"
"""The event of the first line after a time in which the file could not be written."""
AFTER = "after"
"""The field of the line `OPENED` that says what became of the file before."""
_GAP = re.compile(rb'"(?:lost|untold|resumed|after)"')
_BEGIN = b'{"'
_LINE = re.compile(rb'(\{.*),"hash":"([0-9a-f]{64})"\}')


class BrokenChainError(Exception):
    """A line is not what was written there; the message says which and why."""


@dataclass(frozen=True, slots=True)
class Verified:
    """A whole chain, and what its lines themselves say of what is missing.

    Args:
        lines_count: How many lines it has.
        torn_count: How many of them are incomplete: their daemon was killed, or could not write on.
        head: The last hash.
        lost_count: How many lines a daemon could not keep until they could be written.
        untold_count: How many calls have a line without their content.
        interruptions: Why the file could not be written, once for each time.
        losses: What became of the file before this one, once for each time.

    """

    lines_count: int
    torn_count: int
    head: str
    lost_count: int = 0
    untold_count: int = 0
    interruptions: tuple[str, ...] = ()
    losses: tuple[str, ...] = ()


def encoded_entry(entry: dict[str, Any], previous: str) -> tuple[bytes, str]:
    """Returns an entry as a line, without its end, and its hash. `previous` is the hash of the line before."""
    body = json.dumps(entry, allow_nan=False, separators=(",", ":")).encode()
    digest = _digest(body, previous)
    return body[:-1] + f',"hash":"{digest}"}}'.encode(), digest


def hash_of(text: bytes) -> str | None:
    """Returns the hash that a line carries; None if it is no whole line."""
    found = _LINE.fullmatch(text)
    return None if found is None else found[2].decode()


def verify(lines: Iterable[bytes]) -> Verified:
    """Checks the lines of an audit, with their ends.

    Raises:
        BrokenChainError: One of them was changed, or others were before it; or there is none.

    """
    previous, count, torn_count = START, 0, 0
    torn: bytes | None = None
    gaps = _Gaps()
    ends = False
    for number, line_text in enumerate(lines, start=1):
        count, ends, text = number, line_text.endswith(b"\n"), line_text.rstrip(b"\n")
        found = _LINE.fullmatch(text)
        if found is None:
            if torn is not None:
                raise BrokenChainError(f"line {number - 1} is no line of an audit")
            torn, torn_count = text, torn_count + 1
            continue
        body, digest = found[1] + b"}", found[2].decode()
        if torn is not None and _torn_hash(body) != hashlib.sha256(torn).hexdigest():
            raise BrokenChainError(f"line {number - 1} is no line of an audit")
        if digest != _digest(body, previous):
            raise BrokenChainError(f"line {number} was changed, or lines before it were removed, added or swapped")
        previous, torn = digest, None
        try:
            gaps.add(body)
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):  # no daemon wrote it
            raise BrokenChainError(f"line {number} is no line of an audit") from None
    if previous == START:
        raise BrokenChainError("it has no whole line of an audit")
    if torn is not None and (ends or not torn.startswith(_BEGIN)):  # a killed daemon ends amid a line
        raise BrokenChainError(f"line {count} is no line of an audit")
    gap_texts = tuple(gaps.interruptions), tuple(gaps.losses)
    return Verified(count, torn_count, previous, gaps.lost_count, gaps.untold_count, *gap_texts)


class _Gaps:
    """Texts of lines about missing ones beside them."""

    def __init__(self) -> None:
        self.lost_count = self.untold_count = 0
        self.interruptions: list[str] = []
        self.losses: list[str] = []

    def add(self, body: bytes) -> None:
        """Takes note of a line whose hash is right."""
        if not _GAP.search(body):
            return
        entry = json.loads(body)  # as a daemon has made it
        event = entry.get("event")
        if event == LOST:
            self.lost_count += int(entry["lines"])
        elif event == RESUMED:
            self.interruptions.append(str(entry["why"]))
        elif event == OPENED and AFTER in entry:
            self.losses.append(str(entry[AFTER]))
        elif event == UNTOLD or UNTOLD in entry:
            self.untold_count += 1


def _torn_hash(body: bytes) -> str | None:
    try:
        entry = json.loads(body)
    except (ValueError, RecursionError):  # no daemon wrote it
        return None
    found = entry.get(TORN) if entry.get("event") == OPENED else None
    return found if isinstance(found, str) else None


def _digest(body: bytes, previous: str) -> str:
    return hashlib.sha256(previous.encode() + body).hexdigest()
