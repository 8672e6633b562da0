"""Kinds of MAVLink messages: their fields, and messages from values and from the content of frames."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

Message: TypeAlias = Any
"""A message, whose fields are attributes that no type has."""


class MessageHeader(NamedTuple):
    """The part of a frame's header that messages have."""

    msgId: int  # noqa: N815  MAVLink's names, as pymavlink has them
    seq: int
    srcSystem: int  # noqa: N815
    srcComponent: int  # noqa: N815


class MavlinkMessage:
    """A message: one to be sent, or a received one with its header. Its methods are named as pymavlink's."""

    _kind: MessageKind
    _header: MessageHeader

    def __repr__(self) -> str:
        return f"{self._kind.name} { {name: getattr(self, name) for name in self._kind.layout.fields} }"

    def get_kind(self) -> MessageKind:
        """Returns its kind."""
        return self._kind

    def get_type(self) -> str:
        """Returns the name of its kind."""
        return self._kind.name

    def get_msgId(self) -> int:  # noqa: N802
        """Returns the id of its kind."""
        return self._kind.id

    def get_fieldnames(self) -> tuple[str, ...]:
        """Returns the names of its fields, in the order of their definition."""
        return self._kind.layout.fields

    def get_header(self) -> MessageHeader:
        """Returns the header with which it was received."""
        return self._header

    def get_seq(self) -> int:
        """Returns the sequence number with which it was received."""
        return self._header.seq

    def get_srcSystem(self) -> int:  # noqa: N802
        """Returns the system from which it was received."""
        return self._header.srcSystem

    def get_srcComponent(self) -> int:  # noqa: N802
        """Returns the component from which it was received."""
        return self._header.srcComponent

    def get_payload(self) -> bytes:
        """Returns its content as bytes, with all zeros at the end."""
        layout = self._kind.layout
        values: list[Any] = []
        for name in layout.ordered:
            value = getattr(self, name)
            values.extend(value) if name in layout.array_names else values.append(value)
        return layout.payload.pack(*values)


class _Layout(NamedTuple):
    """Fields in the order of their definition, and on the wire: a name for each value there."""

    fields: tuple[str, ...]
    extensions: Mapping[str, Any]
    """The fields that a message may lack, with their values then."""
    payload: struct.Struct
    ordered: tuple[str, ...]
    names: tuple[str, ...]
    arrays: tuple[tuple[str, int, int], ...]
    """For each array where its values begin and end."""
    array_names: frozenset[str]
    texts: tuple[str, ...]


class MessageKind:
    """A kind of message.

    `definition` has each field with its code of `struct`, in the order of MAVLink's definition; a bar precedes the
    extensions. It is read when it is first used.
    """

    def __init__(self, message_id: int, name: str, crc_extra: int, definition: str) -> None:
        self.id = message_id
        self.name = name
        self.crc_extra = crc_extra
        self._definition = definition

    def __call__(self, *values: Any, **named: Any) -> Message:  # noqa: ANN401
        """Makes a message of the values of its fields, in the order of their definition or by their names."""
        layout = self.layout
        given = dict(zip(layout.fields, values, strict=False)) | named
        fields = {**layout.extensions, **given}
        if len(given) != len(values) + len(named) or fields.keys() != set(layout.fields):
            raise TypeError(f"{self.name} has the fields {', '.join(layout.fields)}, not these: {values} {named}")
        message = MavlinkMessage()
        message.__dict__ |= fields
        message._kind = self  # noqa: SLF001  one module
        return message

    @cached_property
    def layout(self) -> _Layout:
        """The places of its fields."""
        base, _, further = ([each.split(":") for each in part.split()] for part in self._definition.partition("|"))
        # The largest fields first, but extensions last, in their order.
        ordered = [*sorted(base, key=lambda field: -struct.calcsize(f"<{field[1][-1]}")), *further]
        names: list[str] = []
        arrays = []
        for name, code in ordered:
            count = int(code[:-1] or 1) if code[-1] != "s" else 1
            if code[:-1] and code[-1] != "s":
                arrays.append((name, len(names), len(names) + count))
            names += [name] * count
        empty = {name: b"" if code[-1] == "s" else (0,) * int(code[:-1]) if code[:-1] else 0 for name, code in further}
        return _Layout(
            tuple(name for name, _ in (*base, *further)),
            empty,
            struct.Struct("<" + "".join(code for _, code in ordered)),
            tuple(name for name, _ in ordered),
            tuple(names),
            tuple(arrays),
            frozenset(name for name, _, _ in arrays),
            tuple(name for name, code in ordered if code[-1] == "s"),
        )

    def read(self, payload: bytes, header: tuple[int, int, int, int]) -> Message:
        """Returns the message of this kind with the content and the `MessageHeader` of a frame.

        One with texts has its `content` as it came: the bytes of a parameter may be no number of Python's.
        """
        layout = self.layout
        values = layout.payload.unpack_from(payload.ljust(layout.payload.size, b"\0"))
        message = object.__new__(MavlinkMessage)
        fields = message.__dict__ = dict(zip(layout.names, values, strict=True))
        for name, begin, end in layout.arrays:
            fields[name] = list(values[begin:end])
        if layout.texts:
            fields["content"] = payload
        for name in layout.texts:
            fields[name] = fields[name].split(b"\0", 1)[0].decode("ascii", errors="replace")
        fields["_header"] = tuple.__new__(MessageHeader, header)  # as `MessageHeader(*header)` does, one call less
        fields["_kind"] = self
        return message
