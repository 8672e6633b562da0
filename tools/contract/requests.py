"""Conversion of a member's arguments into the fields of a request, and back; and of a response into a result."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from google.protobuf.descriptor_pb2 import FieldDescriptorProto

from tools.contract import by_hand
from tools.contract.compiled import ROOT
from tools.contract.parts import ContractPart, PartMember
from tools.contract.python_source import functions, parsed
from tools.contract.values import Values
from tools.contract.words import snake

_Type = FieldDescriptorProto
SPECIAL = ROOT / "clients" / "python" / "ual" / "wire" / "requests.py"
"""The requests that are not one field for each argument: functions by hand make and read them."""


def is_special(member: PartMember) -> bool:
    """Returns whether the request of a member is made and read by hand."""
    assert member.method is not None
    return f"{snake(member.method.name)}_arguments" in functions(parsed(SPECIAL))


@dataclass(frozen=True)
class ResultCode:
    """Code of a result: packing, as an expression of ``result``, and reading, as a function of the response."""

    pack: str
    read: str


def result(values: Values, member: PartMember) -> ResultCode:
    """Returns how the result of a member crosses the wire."""
    assert member.method is not None
    assert member.response is not None
    response = member.response
    own = values.messages.get(response.name)
    if own is not None:
        return ResultCode(f"wire.{own.codec}_to_proto(result)", f"wire.{own.codec}_from_proto")
    if not response.field:
        return ResultCode(f"pb.{response.name}()", "nothing")
    [field] = response.field
    part = f"response.{field.name}"
    if field.type == _Type.TYPE_ENUM:
        enum = values.enums[field.type_name]
        number = f"pb.{enum.name}.ValueType"
        pack = f"pb.{response.name}({field.name}=[{number}(each) for each in sorted(each.value for each in result)])"
        known = f"{enum.name}(each) for each in {part} if each in {enum.name}._value2member_map_"
        return ResultCode(pack, f"lambda response: frozenset({known})")
    if field.type != _Type.TYPE_MESSAGE:
        return ResultCode(f"pb.{response.name}({field.name}=result)", f"lambda response: {part}")
    writer, reader = _codec(values, field)
    if member.returned.startswith("dict["):
        pack = f"pb.{response.name}({field.name}=map({writer}, result.items()))"
        return ResultCode(pack, f"lambda response: dict(map({reader}, {part}))")
    if member.returned.endswith(" | None"):
        pack = f"pb.{response.name}({field.name}=None if result is None else {writer}(result))"
        is_there = f'response.HasField("{field.name}")'
        return ResultCode(pack, f"lambda response: {reader}({part}) if {is_there} else None")
    if field.label == _Type.LABEL_REPEATED:
        pack = f"pb.{response.name}({field.name}=map({writer}, result))"
        return ResultCode(pack, f"lambda response: list(map({reader}, {part}))")
    return ResultCode(f"pb.{response.name}({field.name}={writer}(result))", f"lambda response: {reader}({part})")


def _codec(values: Values, field: FieldDescriptorProto) -> tuple[str, str]:
    name = field.type_name.rpartition(".")[2]
    known = by_hand.of(name) if values.file != "ual" else by_hand.MESSAGES.get(name)
    if known is not None:
        return known.writer(), known.reader()
    found = values.messages[name]
    codec = f"samples.{found.codec}" if found.is_late else f"wire.{found.codec}"
    return f"{codec}_to_proto", f"{codec}_from_proto"


def written(values: Values, part: ContractPart, member: PartMember) -> Iterator[str]:
    """Yields the arguments of the request that a client makes."""
    for field in _fields(part, member):
        if field.name == part.bound:
            yield f"{field.name}={field.name}"
        else:
            yield f"{field.name}={_write(values, field)}"


def read(values: Values, part: ContractPart, member: PartMember) -> Iterator[str]:
    """Yields the arguments with which the server calls what a service does."""
    for field in _fields(part, member):
        if field.name == part.bound:
            yield f"request.{field.name}"
        else:
            yield f"{field.name}={read_field(values, field)}"


def checks(member: PartMember) -> Iterator[str]:
    """Yields the statements that refuse an argument of a type which protobuf would take, or name badly."""
    kinds = {each.arg: "" if each.annotation is None else ast.unparse(each.annotation) for each in member.arguments}
    for name, kind in kinds.items():
        if kind == "Transform":
            yield f"checked_transform({name})"
        elif kind in ("str", "Vector3"):
            yield f'require({name}, {kind}, "{name}")'


def made(member: PartMember, fields: Sequence[str]) -> str:
    """Returns the code that makes a request of its fields. Its error names the argument that protobuf refuses."""
    assert member.request is not None
    request = f"pb.{member.request.name}"
    parts = {each.name for each in member.request.field if each.type == _Type.TYPE_MESSAGE}
    if not fields:
        return f"{request}()"
    if not parts or any("stamped_point" in each for each in fields):
        return f"request({request}, {', '.join(fields)})"
    first = next(each.name for each in member.request.field if each.name in parts)
    value = f", {first}" * (first == "transform")
    return f'built(lambda: {request}({", ".join(fields)}), "{first}"{value})'


def _fields(part: ContractPart, member: PartMember) -> list[FieldDescriptorProto]:
    assert member.request is not None
    names = {each.arg for each in member.arguments} | ({part.bound} if part.bound else set())
    fields = list(member.request.field)
    if names != {each.name for each in fields}:
        differing = ", ".join(sorted(names ^ {each.name for each in fields}))
        raise SystemExit(f"{part.name}.{member.name} and {member.request.name} differ: {differing}; see {SPECIAL.name}")
    return fields


def _write(values: Values, field: FieldDescriptorProto) -> str:
    if field.type == _Type.TYPE_ENUM:
        return f'wire.{_enum(values, field)}_to_proto({field.name}, "{field.name}")'
    if field.type == _Type.TYPE_MESSAGE:
        name = field.type_name.rpartition(".")[2]
        if name == "PointStamped":
            return f"convert.point_stamped_to_proto(stamped_point({field.name}))"
        return f"{_codec(values, field)[0]}({field.name})"
    return f'flag({field.name}, "{field.name}")' if field.type == _Type.TYPE_BOOL else field.name


def read_field(values: Values, field: FieldDescriptorProto) -> str:
    """Returns what reads a field of a request."""
    value = f"request.{field.name}"
    if field.type == _Type.TYPE_ENUM:
        return f'wire.{_enum(values, field)}_from_proto({value}, "{field.name}")'
    if field.type == _Type.TYPE_MESSAGE:
        known = by_hand.of(field.type_name.rpartition(".")[2])
        more = f', "{field.name}"' if known is not None and known.names_field else ""
        if known is not None and known.name in ("Vector3", "Transform"):
            value = f'convert.with_part(request, "{field.name}", "{field.name}").{field.name}'
        return f"{_codec(values, field)[1]}({value}{more})"
    return f'{value} if request.HasField("{field.name}") else None' if field.proto3_optional else value


def _enum(values: Values, field: FieldDescriptorProto) -> str:
    return snake(values.enums[field.type_name].name)
