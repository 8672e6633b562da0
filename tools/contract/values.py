"""The values that follow from the messages of a file: their fields, and how each goes into and out of its message."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from google.protobuf.descriptor_pb2 import (
    DescriptorProto,
    EnumDescriptorProto,
    FieldDescriptorProto,
    FileDescriptorProto,
    FileDescriptorSet,
)

from tools.contract import by_hand
from tools.contract.by_hand import ByHand
from tools.contract.comments import comments
from tools.contract.options import Options
from tools.contract.words import comment_text, shouted, snake

_Type = FieldDescriptorProto
_SCALARS = {
    _Type.TYPE_STRING: ("str", '""'),
    _Type.TYPE_BYTES: ("bytes", 'b""'),
    _Type.TYPE_BOOL: ("bool", "False"),
    _Type.TYPE_DOUBLE: ("float", "0.0"),
    **dict.fromkeys((_Type.TYPE_UINT32, _Type.TYPE_UINT64, _Type.TYPE_INT32), ("int", "0")),
}
_TIME, _SPAN = ".google.protobuf.Timestamp", ".google.protobuf.Duration"


@dataclass(frozen=True)
class EnumValue:
    """An enum. `unknown` is the member for what is not set or not known; empty: there is none."""

    name: str
    text: str
    members: Sequence[tuple[str, int, str]]
    unknown: str

    @property
    def table(self) -> str:
        """The name of the table with which numbers are read."""
        return f"_{shouted(self.name)}"


@dataclass(frozen=True)
class Field:
    """A field of a value. `write` and `read` are expressions: of ``value``, and of ``message``."""

    name: str
    attribute: str
    annotation: str
    default: str
    text: str
    write: str
    read: str
    modules: Mapping[str, str] = field(default_factory=dict)
    """The modules of the classes that the annotation names, where they are of another file."""


@dataclass(frozen=True)
class MessageValue:
    """A value of some fields."""

    message: str
    name: str
    text: str
    fields: Sequence[Field]
    given: int
    is_tuple: bool

    @property
    def annotation(self) -> str:
        """Name in annotations."""
        return f"tuple[{', '.join(each.annotation for each in self.fields)}]" if self.is_tuple else self.name

    @property
    def codec(self) -> str:
        """Prefix of the functions that write and read it."""
        return f"{'_' * self.is_tuple}{snake(self.name)}"


@dataclass(frozen=True)
class Values:
    """Values that follow from a file."""

    file: str
    text: str
    enums: Mapping[str, EnumValue]
    messages: Mapping[str, MessageValue]
    in_requests: frozenset[str]
    """The enums that a request has by themselves."""

    @property
    def module(self) -> str:
        """The module of the values: ``ual.gripper``, unless another one is named."""
        return by_hand.PLACES.get(self.file, f"ual.{self.file}")


def all_values(contract: FileDescriptorSet) -> dict[str, Values]:
    """Returns the values of each file that has some, by the name of the file."""
    reader = _Reader(contract)
    files = (each for each in contract.file if each.name.startswith("ual/v1/") and each.name != "ual/v1/options.proto")
    found = (reader.values(each) for each in files if _name(each) not in by_hand.FILES)
    return {each.file: each for each in found}


def _name(file: FileDescriptorProto) -> str:
    return file.name.removeprefix("ual/v1/").removesuffix(".proto")


class _Reader:
    def __init__(self, contract: FileDescriptorSet) -> None:
        self._options = Options(contract)
        self._names = {
            message.name: self._facts(message).name or message.name
            for file in contract.file
            for message in file.message_type
            if file.name.startswith("ual/")
        }
        self._enums: dict[str, EnumValue] = {}
        self._messages: dict[str, MessageValue | None] = {}
        self._declared: dict[str, tuple[FileDescriptorProto, DescriptorProto]] = {
            f".{file.package}.{message.name}": (file, message)
            for file in contract.file
            for message in file.message_type
        }

    def values(self, file: FileDescriptorProto) -> Values:
        about = comments(file)
        enums = {
            f".{file.package}.{each.name}": self._enum(each, about)
            for each in file.enum_type
            if each.name not in by_hand.ENUMS
        }
        self._enums |= enums
        messages = {each.name: self.message(f".{file.package}.{each.name}") for each in file.message_type}
        requests = (each for each in file.message_type if each.name.endswith("Request"))
        asked = frozenset(part.type_name for each in requests for part in each.field if part.type_name in enums)
        kept = {name: each for name, each in messages.items() if each is not None}
        text = comment_text(about[""], self._names)
        return Values(_name(file), text, enums, dict(sorted(kept.items(), key=_depth(kept))), asked)

    def message(self, full_name: str) -> MessageValue | None:
        """Returns the value of a message; None where it is none."""
        if full_name not in self._messages:
            self._messages[full_name] = self._message(*self._declared[full_name])
        return self._messages[full_name]

    def _message(self, file: FileDescriptorProto, message: DescriptorProto) -> MessageValue | None:
        facts = self._facts(message)
        is_wrapper = message.name.endswith(("Request", "Response")) and not facts.name
        if is_wrapper or message.name in by_hand.MESSAGES:
            return None
        about = comments(file)
        fields = [self._field(message, each, about) for each in message.field]
        text = comment_text(about[message.name], self._names)
        return MessageValue(message.name, self._names[message.name], text, fields, facts.given, facts.is_tuple)

    def _facts(self, message: DescriptorProto) -> Any:  # noqa: ANN401 (a message that is made at run time)
        return self._options.read("Message", "value_facts", message.options)

    def _enum(self, enum: EnumDescriptorProto, about: Mapping[str, str]) -> EnumValue:
        unknown: str = self._options.read("Enum", "enum_facts", enum.options).unknown
        prefix = f"{shouted(enum.name)}_"
        names = {each.number: each.name.removeprefix(prefix) for each in enum.value}
        if unknown and unknown not in names.values():
            names[0] = unknown
        else:
            del names[0]
        texts = {each.number: comment_text(about[f"{enum.name}.{each.name}"], self._names) for each in enum.value}
        members = [(name, number, texts[number]) for number, name in sorted(names.items())]
        return EnumValue(enum.name, comment_text(about[enum.name], self._names), members, unknown)

    def _field(self, message: DescriptorProto, part: FieldDescriptorProto, about: Mapping[str, str]) -> Field:
        facts = self._options.read("Field", "field_facts", part.options)
        text = comment_text(about[f"{message.name}.{part.name}"], self._names)
        made = _Made(self, part, facts)
        return Field(
            part.name, made.attribute, made.annotation, made.default, text, made.write, made.read, made.modules
        )

    def enum(self, full_name: str) -> EnumValue:
        """Returns an enum of this file."""
        return self._enums[full_name]


class _Made:
    """Code of one field: its declaration, writing and reading."""

    def __init__(self, reader: _Reader, part: FieldDescriptorProto, facts: Any) -> None:  # noqa: ANN401
        self._reader = reader
        self._part = part
        self._facts = facts
        self.attribute = facts.name or (f"{part.name}_s" if part.type_name in (_TIME, _SPAN) else part.name)
        self._of_value = f"value.{self.attribute}"
        self._of_message = f"message.{part.name}"
        self.modules: dict[str, str] = {}
        self._is_repeated = part.label == _Type.LABEL_REPEATED
        self.annotation, self.default, self.write, self.read = self._made()

    def _made(self) -> tuple[str, str, str, str]:
        part = self._part
        if part.type == _Type.TYPE_ENUM:
            return self._enum(self._reader.enum(part.type_name))
        if part.type == _Type.TYPE_MESSAGE:
            return self._message()
        kind, zero = _SCALARS[part.type]
        if self._is_repeated:
            return f"tuple[{kind}, ...]", "()", self._of_value, f"tuple({self._of_message})"
        if part.proto3_optional:
            return f"{kind} | None", "None", self._of_value, self._if_set(self._of_message)
        return kind, "True" if self._facts.is_true else zero, self._of_value, self._of_message

    def _enum(self, enum: EnumValue) -> tuple[str, str, str, str]:
        number = f"pb.{enum.name}.ValueType"
        if self._is_repeated:
            write = f"[{number}(each) for each in sorted(each.value for each in {self._of_value})]"
            read = f"frozenset({enum.table}[each] for each in {self._of_message} if each in {enum.table})"
            return f"frozenset[{enum.name}]", "frozenset()", write, read
        if enum.unknown:
            known = f"{enum.name}.{enum.unknown}"
            read = f"{enum.table}.get({self._of_message}, {known})"
            return enum.name, known, f"{number}({self._of_value}.value)", read
        write = f"{number}(0 if {self._of_value} is None else {self._of_value}.value)"
        return f"{enum.name} | None", "None", write, f"{enum.table}.get({self._of_message})"

    def _message(self) -> tuple[str, str, str, str]:
        kind, writer, reader, more = self._codec()
        if self._is_repeated:
            read = f"tuple(map({reader}, {self._of_message}))"
            return f"tuple[{kind}, ...]", "()", f"map({writer}, {self._of_value})", read
        write, read = f"{writer}({self._of_value})", f"{reader}({self._of_message}{more})"
        if self._facts.is_there:
            return kind, "0.0" if kind == "float" else f"{kind}()", write, read
        write = f"None if {self._of_value} is None else {write}"
        return f"{kind} | None", "None", write, self._if_set(read)

    def _codec(self) -> tuple[str, str, str, str]:
        """Returns the class, what writes and what reads it, and what the reader takes more."""
        name = self._part.type_name
        if name in (_TIME, _SPAN):
            writer, reader = ("timestamp", "stamp") if name == _TIME else ("duration", "duration")
            return "float", f"convert.{writer}_to_proto", f"convert.{reader}_from_proto", ""
        known = by_hand.MESSAGES.get(name.rpartition(".")[2])
        if isinstance(known, ByHand):
            self.modules[known.name] = known.module
            return known.name, known.writer(), known.reader(), f', "{self._part.name}"' * known.names_field
        found = self._reader.message(name)
        if found is None:
            raise SystemExit(f"{name} is no value: it cannot be a field of one")
        return found.annotation, f"{found.codec}_to_proto", f"{found.codec}_from_proto", ""

    def _if_set(self, read: str) -> str:
        return f'{read} if message.HasField("{self._part.name}") else None'


def _depth(messages: Mapping[str, MessageValue]) -> Any:  # noqa: ANN401 (a key of sorted)
    """Returns a key that puts what others are made of before these."""
    names = {each.name: each for each in messages.values()}

    def depth(item: tuple[str, MessageValue]) -> int:
        return _depth_of(item[1], names)

    return depth


def _depth_of(value: MessageValue, names: Mapping[str, MessageValue]) -> int:
    parts: Iterator[MessageValue] = (
        names[each] for part in value.fields for each in names if each in _words(part.annotation)
    )
    return 1 + max((_depth_of(each, names) for each in parts if each is not value), default=0)


def _words(annotation: str) -> set[str]:
    return set(annotation.replace("[", " ").replace("]", " ").replace(",", " ").split())
