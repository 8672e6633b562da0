"""Kinds of MAVLink messages: their fields, and messages from values and from the content of frames."""

from __future__ import annotations

import struct
from collections import namedtuple
from collections.abc import Callable, Mapping
from functools import cached_property, partial
from typing import Any, NamedTuple, TypeAlias

Message: TypeAlias = Any
"""A message, whose fields are attributes that no type has."""


class MessageHeader(NamedTuple):
    """The part of a frame's header that messages have."""

    msgId: int  # noqa: N815  MAVLink's names, as pymavlink has them
    seq: int
    srcSystem: int  # noqa: N815
    srcComponent: int  # noqa: N815


class MavlinkMessage(tuple[Any, ...]):
    """A message: one to be sent, or a received one. Its methods are named as pymavlink's.

    It has its values as on the wire, its content as it came, and its header. Each kind has a class of its own, with the
    fields as attributes (`MessageKind.message_class`).
    """

    __slots__ = ()
    _kind: MessageKind

    @property
    def content(self) -> bytes:
        """Its content as it came: the bytes of a parameter may be no number of Python's. Empty where it is sent."""
        content: bytes = self[-2]
        return content

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
        return MessageHeader(*self[-1])

    def get_seq(self) -> int:
        """Returns the sequence number with which it was received."""
        return self.get_header().seq

    def get_srcSystem(self) -> int:  # noqa: N802
        """Returns the system from which it was received."""
        return self.get_header().srcSystem

    def get_srcComponent(self) -> int:  # noqa: N802
        """Returns the component from which it was received."""
        return self.get_header().srcComponent

    def get_payload(self) -> bytes:
        """Returns its content as bytes, with all zeros at the end."""
        return self._kind.layout.payload.pack(*self[:-2])


class _Layout(NamedTuple):
    """Fields in the order of their definition, and on the wire: a name for each value there."""

    fields: tuple[str, ...]
    extensions: Mapping[str, Any]
    """The fields that a message may lack, with their values then."""
    payload: struct.Struct
    ordered: tuple[str, ...]
    names: tuple[str, ...]
    arrays: Mapping[str, slice]
    """The places of the values of each array."""
    texts: Mapping[str, int]
    """The place of each text."""


_Reader: TypeAlias = tuple[Callable[[bytes], tuple[Any, ...]], int, type[MavlinkMessage]]
"""A layout's unpacking, its size, and the class of the messages."""


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
        self._reader: _Reader | None = None

    def __call__(self, *values: Any, **named: Any) -> Message:  # noqa: ANN401
        """Makes a message of the values of its fields, in the order of their definition or by their names."""
        layout = self.layout
        given = dict(zip(layout.fields, values, strict=False)) | named
        fields = {**layout.extensions, **given}
        if len(given) != len(values) + len(named) or fields.keys() != set(layout.fields):
            raise TypeError(f"{self.name} has the fields {', '.join(layout.fields)}, not these: {values} {named}")
        found: list[Any] = []
        for name in layout.ordered:
            found.extend(fields[name]) if name in layout.arrays else found.append(fields[name])
        return self.message_class((*found, b"", (self.id, 0, 0, 0)))

    @cached_property
    def layout(self) -> _Layout:
        """The places of its fields."""
        base, _, further = ([each.split(":") for each in part.split()] for part in self._definition.partition("|"))
        # The largest fields first, but extensions last, in their order.
        ordered = [*sorted(base, key=lambda field: -struct.calcsize(f"<{field[1][-1]}")), *further]
        names: list[str] = []
        arrays, texts = {}, {}
        for name, code in ordered:
            count = int(code[:-1] or 1) if code[-1] != "s" else 1
            if code[-1] == "s":
                texts[name] = len(names)
            elif code[:-1]:
                arrays[name] = slice(len(names), len(names) + count)
            names += [name] * count
        empty = {name: b"" if code[-1] == "s" else (0,) * int(code[:-1]) if code[:-1] else 0 for name, code in further}
        return _Layout(
            tuple(name for name, _ in (*base, *further)),
            empty,
            struct.Struct("<" + "".join(code for _, code in ordered)),
            tuple(name for name, _ in ordered),
            tuple(names),
            arrays,
            texts,
        )

    @cached_property
    def message_class(self) -> type[MavlinkMessage]:
        """The class of its messages. An array and a text are made when they are asked for."""
        layout = self.layout
        # An array has its name several times: the later ones get names of their own.
        getters = vars(namedtuple(self.name, layout.names, rename=True))  # noqa: PYI024
        fields: dict[str, Any] = {name: getters[name] for name in getters["_fields"]}
        fields |= {name: property(partial(_array, at)) for name, at in layout.arrays.items()}
        fields |= {name: property(partial(_text, at)) for name, at in layout.texts.items()}
        return type(self.name, (MavlinkMessage,), {"__slots__": (), "_kind": self, **fields})

    def read(self, payload: bytes, header: tuple[int, int, int, int]) -> Message:
        """Returns the message of this kind with the content and the `MessageHeader` of a frame."""
        unpack, size, message_class = self._reader or self._make_reader()
        whole = payload if len(payload) >= size else payload.ljust(size, b"\0")
        return message_class(unpack(whole) + (payload, header))  # noqa: RUF005  half of the instructions

    def _make_reader(self) -> _Reader:
        payload = self.layout.payload
        reader = self._reader = payload.unpack_from, payload.size, self.message_class
        return reader


def _array(place: slice, message: MavlinkMessage) -> list[Any]:
    return list(message[place])


def _text(place: int, message: MavlinkMessage) -> str:
    text: bytes = message[place]
    return text.split(b"\0", 1)[0].decode("ascii", errors="replace")
