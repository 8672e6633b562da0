"""The checks of requests, once for all services: their stamps and durations, and the length of their lists.

A protobuf Timestamp carries any 64-bit number. What is beyond its documented range ends in an error wherever it is
converted: in the audit, in recordings, in a client.

An empty element of a list takes two bytes: two million of them are a request of 4 MB, and a gigabyte once it is read.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import lru_cache
from typing import Any, Final, NamedTuple, TypeAlias

from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.message import Message

from ual.errors import InvalidArgumentError, ResourceExhaustedError

MOST_ELEMENTS: Final = 40_000
"""Elements in all lists of a request. The longest path has 10,000 waypoints with a speed and a hold for each."""
_OURS = "ual.v1"
_YEAR_1_S, _YEAR_9999_S = -62_135_596_800, 253_402_300_799
_LONGEST_PROTO_DURATION_S = 315_576_000_000
_NANOS_PER_S = 1_000_000_000
_TIMESTAMP, _DURATION = "google.protobuf.Timestamp", "google.protobuf.Duration"


Ways: TypeAlias = "tuple[tuple[tuple[str, ...], bool], ...]"
"""For each time the fields that lead to it, and whether these are all: else lists, maps or the same kind follow."""


class _Part(NamedTuple):
    """A field that is a time, or that leads to one."""

    name: str
    is_repeated: bool
    is_map: bool
    kind: Descriptor


def has_lists(kind: Descriptor) -> bool:
    """Returns whether messages of a kind have lists that are to be short: those of UAL's own services."""
    return kind.file.package == _OURS and bool(_lists(kind))


def require_few(message: Message) -> None:
    """Requires that the lists of a message are not too long to be read.

    Raises:
        ResourceExhaustedError: They have more than `MOST_ELEMENTS` elements.

    """
    if _count(message) > MOST_ELEMENTS:
        raise ResourceExhaustedError(
            f"{message.DESCRIPTOR.name}: its lists have more than {MOST_ELEMENTS} elements; send fewer at once",
            {"limit": str(MOST_ELEMENTS)},
        )


def _count(message: Message) -> int:
    """Returns the count of elements; of those within elements only while there are not too many."""
    count = 0
    for name, is_repeated, has_more in _lists(message.DESCRIPTOR):
        found: Any = getattr(message, name)
        if is_repeated:
            count += len(found)
        if has_more and count <= MOST_ELEMENTS:
            count += sum(map(_count, found)) if is_repeated else _count(found)
    return count


@lru_cache(maxsize=1024)
def _lists(kind: Descriptor) -> tuple[tuple[str, bool, bool], ...]:
    """Returns the fields of a message that are lists, or have some below: name, whether it is one, and has some."""
    fields = ((each, bool(each.message_type) and _has_list(each.message_type, frozenset())) for each in kind.fields)
    return tuple((each.name, each.is_repeated, has_more) for each, has_more in fields if each.is_repeated or has_more)


def _has_list(kind: Descriptor, above: frozenset[str]) -> bool:
    if kind.full_name in above:
        return False
    above |= {kind.full_name}
    return any(each.is_repeated or (each.message_type and _has_list(each.message_type, above)) for each in kind.fields)


def require_times(message: Message, paths: Ways) -> None:
    """Requires that each time of a message, at any depth, is one. Each setpoint passes through it.

    `paths` are those of its kind (`ways_to_times`).

    Raises:
        InvalidArgumentError: One is out of range; metadata ``field`` names it.

    """
    for names, is_leaf in paths:
        found: Any = message
        for name in names:
            if not found.HasField(name):
                break
            found = getattr(found, name)
        else:
            if not is_leaf or found.ByteSize():
                _require(message, _parts(message.DESCRIPTOR), "")
                return


def paths_to_times(kind: Descriptor) -> Ways:
    """Returns the fields that lead to each time of a kind of message; none where it has no time."""
    return tuple(_field_paths_of(_parts(kind), (), frozenset({kind.full_name})))


def _field_paths_of(
    parts: Iterable[_Part], above: tuple[str, ...], kinds: frozenset[str]
) -> Iterator[tuple[tuple[str, ...], bool]]:
    for part in parts:
        if part.kind.full_name in (_TIMESTAMP, _DURATION) and not part.is_repeated:
            yield (*above, part.name), True
        elif part.is_repeated or part.kind.full_name in kinds:
            yield above, False
        else:
            yield from _field_paths_of(_parts(part.kind), (*above, part.name), kinds | {part.kind.full_name})


def _require(message: Message, parts: Iterable[_Part], above: str) -> None:
    for part in parts:
        if part.is_repeated:
            found: Any = getattr(message, part.name)
            for key, each in found.items() if part.is_map else enumerate(found):
                _require_one(each, part.kind, f"{above}{part.name}[{key}]")
        elif message.HasField(part.name):
            _require_one(getattr(message, part.name), part.kind, above + part.name)


def _require_one(value: Any, kind: Descriptor, field: str) -> None:  # noqa: ANN401  a message that fits its descriptor
    if kind.full_name == _TIMESTAMP:
        if not (_YEAR_1_S <= value.seconds <= _YEAR_9999_S and 0 <= value.nanos < _NANOS_PER_S):
            raise _refusal(value, field, f"seconds {_YEAR_1_S} to {_YEAR_9999_S}, nanos 0 to 999999999")
    elif kind.full_name == _DURATION:
        has_one_sign = value.seconds * value.nanos >= 0
        if not (has_one_sign and abs(value.seconds) <= _LONGEST_PROTO_DURATION_S and abs(value.nanos) < _NANOS_PER_S):
            raise _refusal(value, field, "seconds of at most 10000 years, nanos of the same sign below 1 s")
    else:
        _require(value, _parts(kind), field + ".")


def _refusal(value: Any, field: str, needed: str) -> InvalidArgumentError:  # noqa: ANN401  as above
    return InvalidArgumentError(
        f"{field} is no time: seconds {value.seconds}, nanos {value.nanos}; it needs {needed}", {"field": field}
    )


@lru_cache(maxsize=1024)
def _parts(kind: Descriptor) -> tuple[_Part, ...]:
    """Returns the fields of a message that lead to a time."""
    return tuple(_part(field) for field in kind.fields if _leads_to_time(field, frozenset()))


def _part(field: FieldDescriptor) -> _Part:
    kind = field.message_type
    is_map = kind.GetOptions().map_entry
    below = kind.fields_by_name["value"].message_type if is_map else kind
    return _Part(field.name, field.is_repeated, is_map, below)


def _leads_to_time(field: FieldDescriptor, above: frozenset[str]) -> bool:
    kind = field.message_type
    if kind is None or kind.full_name in above:
        return False
    if kind.full_name in (_TIMESTAMP, _DURATION):
        return True
    return any(_leads_to_time(each, above | {kind.full_name}) for each in kind.fields)
