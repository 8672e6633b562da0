"""The values that follow from the messages of a file: their fields, and how each goes into and out of its message."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
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
_HEADER = ".ual.v1.Header"


@dataclass(frozen=True)
class EnumValue:
    """An enum. `unknown` is the member for what is not set or not known; empty: there is none."""

    name: str
    text: str
    members: Sequence[tuple[str, int, str]]
    unknown: str
    is_rising: bool = False

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
    is_rare: bool = False
    after: str = ""
    """The declaration of an attribute before it that only the value has."""


@dataclass(frozen=True)
class MessageValue:
    """A value of some fields."""

    message: str
    name: str
    text: str
    fields: Sequence[Field]
    given: int
    is_tuple: bool
    is_late: bool = False
    variants: Sequence[tuple[str, MessageValue]] = ()
    """The values of which it is one, each with its field. Empty: it is a value of its own."""

    @property
    def annotation(self) -> str:
        """Name in annotations."""
        return f"tuple[{', '.join(each.annotation for each in self.fields)}]" if self.is_tuple else self.name

    @property
    def codec(self) -> str:
        """Prefix of the functions that write and read it."""
        return snake(self.name)


@dataclass(frozen=True)
class Values:
    """Values that follow from a file."""

    file: str
    text: str
    enums: Mapping[str, EnumValue]
    messages: Mapping[str, MessageValue]
    in_requests: frozenset[str]
    """The enums that a request has by themselves."""
    place: str = ""
    """The module of an extension's values."""
    package: str = "ual.v1"
    """Package of the stubs."""

    @property
    def module(self) -> str:
        """The module of the values: ``ual.gripper``, unless another one is named."""
        return self.place or by_hand.PLACES.get(self.file, f"ual.{self.file}")

    @property
    def wire(self) -> str:
        """The module of their codec."""
        return "uav" if self.file == "ual" else self.file


def all_values(contract: FileDescriptorSet) -> dict[str, Values]:
    """Returns the values of each file that has some, by the name of the file."""
    reader = _ValueReader(contract)
    files = (each for each in contract.file if each.name.startswith("ual/v1/") and each.name != "ual/v1/options.proto")
    found = (reader.values(each) for each in files if _name(each) not in by_hand.FILES)
    return {each.file: each for each in found}


def values_of(contract: FileDescriptorSet, file: FileDescriptorProto, place: str, package: str) -> Values:
    """Returns the values of an extension's file, which are in the module `place`, and the stubs in `package`."""
    return replace(_ValueReader(contract).values(file), place=place, package=package)


def _name(file: FileDescriptorProto) -> str:
    return file.name.rpartition("/")[2].removesuffix(".proto")


class _ValueReader:
    def __init__(self, contract: FileDescriptorSet) -> None:
        self._options = Options(contract)
        self._names = {
            message.name: self._facts(message).name or message.name
            for file in contract.file
            for message in file.message_type
            if not file.name.startswith("google/")
        }
        self._file = self._package = ""
        self._asked: set[str] = set()
        """The messages that requests have."""
        self._owners: dict[str, str] = {}
        """Prefixes of errors in the message of a choice, by the name of the message."""
        self._enums: dict[str, EnumValue] = {}
        self._messages: dict[str, MessageValue | None] = {}
        self._declared: dict[str, tuple[FileDescriptorProto, DescriptorProto]] = {
            f".{file.package}.{message.name}": (file, message)
            for file in contract.file
            for message in file.message_type
        }

    def values(self, file: FileDescriptorProto) -> Values:
        self._file, self._package = _name(file), file.package
        requests = [each for each in file.message_type if each.name.endswith("Request")]
        self._asked = {part.type_name for each in requests for part in each.field}
        self._owners = {
            part.type_name.rpartition(".")[2]: f"{snake(choice.name)}.{part.name}."
            for choice in filter(_is_choice, file.message_type)
            for part in choice.field
        }
        about = comments(file)
        enums = {
            f".{file.package}.{each.name}": self._enum(each, about)
            for each in file.enum_type
            if each.name not in by_hand.ENUMS
        }
        self._enums |= enums
        messages = {each.name: self.message(f".{file.package}.{each.name}") for each in file.message_type}
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
        text = comment_text(about[message.name], self._names)
        if _is_choice(message):
            variants = [(each.name, self._variant(message, each)) for each in message.field]
            return MessageValue(message.name, self._names[message.name], text, (), 0, False, variants=variants)
        fields = [field for each in message.field for field in self._fields(message, each, about)]
        return MessageValue(
            message.name, self._names[message.name], text, fields, facts.given, facts.is_tuple, facts.is_late
        )

    def _variant(self, owner: DescriptorProto, part: FieldDescriptorProto) -> MessageValue:
        """Returns one of the values that a message may have."""
        found = self.message(part.type_name)
        if found is None:
            raise SystemExit(f"{owner.name}.{part.name} is no value")
        return found

    def _facts(self, message: DescriptorProto) -> Any:  # noqa: ANN401 (a message that is made at run time)
        return self._options.read("Message", "value_facts", message.options)

    def _enum(self, enum: EnumDescriptorProto, about: Mapping[str, str]) -> EnumValue:
        facts = self._options.read("Enum", "enum_facts", enum.options)
        unknown: str = facts.unknown
        names = {each.number: _member_name(enum.name, each.name) for each in enum.value}
        if unknown and unknown not in names.values():
            names[0] = unknown
        else:
            del names[0]
        texts = {each.number: comment_text(about[f"{enum.name}.{each.name}"], self._names) for each in enum.value}
        members = [(name, number, texts[number]) for number, name in sorted(names.items())]
        return EnumValue(enum.name, comment_text(about[enum.name], self._names), members, unknown, facts.is_rising)

    def _fields(
        self, message: DescriptorProto, part: FieldDescriptorProto, about: Mapping[str, str]
    ) -> Iterator[Field]:
        """Yields the attributes of a field: one, or of a header the stamp and the frame."""
        facts = self._options.read("Field", "field_facts", part.options)
        text = comment_text(about[f"{message.name}.{part.name}"], self._names)
        if part.type_name == _HEADER:
            yield from _of_header(part.name, facts, text)
            return
        is_told = not self._facts(message).is_late and f".{self._package}.{message.name}" not in self._asked
        owner = self._owners.get(message.name, f"{snake(message.name)}." * is_told)
        made = _Made(self, part, facts, owner, is_asked=message.name in self._owners)
        yield Field(
            part.name,
            made.attribute,
            made.annotation,
            facts.default or made.default,
            text,
            made.write,
            made.read,
            made.modules,
            facts.is_rare,
            facts.after_attribute,
        )

    def by_hand(self, full_name: str) -> ByHand | None:
        """Returns the value of a message that is by hand, or that this file has from that of the UAV."""
        name = full_name.rpartition(".")[2]
        return by_hand.MESSAGES.get(name) if self._file == "ual" else by_hand.of(name)

    def enum(self, full_name: str) -> EnumValue:
        """Returns an enum of this file."""
        return self._enums[full_name]


def _is_choice(message: DescriptorProto) -> bool:
    """Returns whether a message is one of several messages, and nothing else."""
    is_one_of = [each.HasField("oneof_index") and not each.proto3_optional for each in message.field]
    return len(message.oneof_decl) == 1 and all(is_one_of)


def _member_name(enum: str, value: str) -> str:
    """Returns the name of a member: ``FIX_2D`` of ``GPS_FIX_2D``, as no name begins with a digit."""
    prefix = shouted(enum)
    name = value.removeprefix(f"{prefix}_")
    return name if name.isidentifier() else f"{prefix.rpartition('_')[2]}_{name}"


def _of_header(name: str, facts: Any, text: str) -> Iterator[Field]:  # noqa: ANN401 (as `_facts`)
    """Yields the attributes of a header: of one that has another name, only its frame."""
    frame = f"message.{name}.frame_id"
    if facts.name:
        made = f"pb.Header(frame_id=value.{facts.name})"
        yield Field(name, facts.name, "str", facts.default or '""', text, made, frame)
        return
    of_stamp, _, of_frame = text.partition(". ")
    yield Field(name, "stamp_s", "float", "0.0", f"{of_stamp}.", "", f"convert.stamp_from_proto(message.{name}.stamp)")
    yield Field(name, "frame_id", "str", '""', of_frame, "", frame)


class _Made:
    """Code of one field: its declaration, writing and reading."""

    def __init__(
        self,
        reader: _ValueReader,
        part: FieldDescriptorProto,
        facts: Any,  # noqa: ANN401 (as `_facts`)
        owner: str,
        *,
        is_asked: bool = False,
    ) -> None:
        """`is_asked`: a caller gives it, so that a message which is always there must be given."""
        self._is_asked = is_asked
        self._reader = reader
        self._error_name = f"{owner}{part.name}"
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
        if self._facts.zero_is_none:
            return f"{kind} | None", "None", f"{self._of_value} or {zero}", f"{self._of_message} or None"
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
        if enum.is_rising:
            names = [name for name, _, _ in enum.members]
            lowest, highest = f"{enum.name}.{names[0]}", f"{enum.name}.{names[-1]}"
            read = f"{enum.name}(min(max({self._of_message}, {lowest}), {highest}))"
            return enum.name, lowest, f"{number}({self._of_value}.value)", read
        if self._facts.is_there:
            unset = f"{enum.name}.{enum.unknown}" if enum.unknown else ""
            arguments = ", ".join(filter(None, (self._of_message, enum.table, f'"{self._error_name}"', unset)))
            return enum.name, unset, f"{number}({self._of_value}.value)", f"member_of({arguments})"
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
        if self._is_asked and self._facts.is_there:
            read = f'{reader}(convert.with_part(message, "{self._part.name}", "{self._error_name}").{self._part.name})'
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
        known = self._reader.by_hand(name)
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
    parts = [names[each] for part in value.fields for each in names if each in _words(part.annotation)]
    parts += [each for _, each in value.variants]
    return 1 + max((_depth_of(each, names) for each in parts if each is not value), default=0)


def _words(annotation: str) -> set[str]:
    return set(annotation.replace("[", " ").replace("]", " ").replace(",", " ").split())
