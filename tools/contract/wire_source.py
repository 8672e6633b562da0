"""Writes the modules of ``ual/wire`` that make messages of the values of a file, and read them."""

from __future__ import annotations

from collections.abc import Iterator

from tools.contract.values import EnumValue, Field, MessageValue, Values
from tools.contract.words import shouted, snake

_OTHERS = ("convert", "mission_items", "rally_points", "uav")
"""The modules of codecs that others use."""


def source(values: Values) -> str:
    """Returns the module."""
    asked = "".join(_argument(values.enums[name]) for name in sorted(values.in_requests))
    functions = asked + "".join(map(_codec, values.messages.values()))
    body = "".join(_table(each) for each in values.enums.values() if each.table in functions) + functions
    return f"{_head(values, body)}{body}"


def _head(values: Values, body: str) -> str:
    classes = [each.name for each in values.enums.values()] + [each.name for each in values.messages.values()]
    used = sorted({name for name in classes if name in body and not _is_tuple(values, name)})
    checks = [each for each in ("member_of", "number_of") if f"{each}(" in body]
    return (
        f'"""Between the messages of ``{values.file}.proto`` and their values. ``make proto`` writes this file: do not '
        'edit it."""\n\nfrom __future__ import annotations\n\n'
        + "from collections.abc import Callable, Mapping\n\n" * ("Callable[" in body)
        + "from collections.abc import Mapping\n\n" * ("Mapping[" in body and "Callable[" not in body)
        + f"from {values.module} import {', '.join(used)}\n"
        + f"from {values.package} import {values.file}_pb2 as pb\n"
        + "".join(f"from ual.wire import {each}\n" for each in _OTHERS if f" {each}." in body or f"({each}." in body)
        + (f"from ual.wire.enums import {', '.join(checks)}\n" if checks else "")
    )


def _is_tuple(values: Values, name: str) -> bool:
    return any(each.is_tuple and each.name == name for each in values.messages.values())


def _table(enum: EnumValue) -> str:
    return f"\n{enum.table}: Mapping[int, {enum.name}] = {{each.value: each for each in {enum.name}}}\n"


def _argument(enum: EnumValue) -> str:
    """The functions of an enum that a request has: what is not set, or not known, is refused."""
    name, unset = snake(enum.name), f", {enum.name}.{enum.unknown}" if enum.unknown else ""
    return f'''

def {name}_to_proto(value: {enum.name}, field: str) -> pb.{enum.name}.ValueType:
    """Makes a number of an enum. Raises `InvalidArgumentError` for what is no member of it."""
    return pb.{enum.name}.ValueType(number_of(value, {enum.name}, field))


def {name}_from_proto(number: int, field: str) -> {enum.name}:
    """Reads a number of an enum. Raises `InvalidArgumentError` for one that is not known, or not set."""
    return member_of(number, {enum.table}, field{unset})
'''


def _codec(value: MessageValue) -> str:
    if value.is_late:
        return _late(value)
    if value.variants:
        return _choice(value)
    private = value.is_tuple
    made = "".join(f"        {each.name}={each.write},\n" for each in value.fields)
    read = "".join(f"        {each.read},\n" for each in value.fields)
    unpacked = f"    {', '.join(each.attribute for each in value.fields)} = value\n" if value.is_tuple else ""
    if private:
        made = made.replace("value.", "")
    call = f"({read})" if value.is_tuple else f"{value.name}(\n{read})"
    return f'''

def {value.codec}_to_proto({"value" if made else "_"}: {value.annotation}) -> pb.{value.message}:
    """Makes a message."""
{unpacked}    return pb.{value.message}(
{made}    )


def {value.codec}_from_proto({"message" if read else "_"}: pb.{value.message}) -> {value.annotation}:
    """Reads a message."""
    return {call}
'''


def _choice(value: MessageValue) -> str:
    """The codec of one of several values."""
    name, message = value.codec, f"pb.{value.message}"
    made = "".join(
        f"        case {each.name}():\n            return {message}({field}={each.codec}_to_proto(value))\n"
        for field, each in value.variants
    )
    read = "".join(
        f'        case "{field}":\n            return {each.codec}_from_proto(message.{field})\n'
        for field, each in value.variants
    )
    return f'''

def {name}_to_proto(value: {value.name}) -> {message}:
    """Makes a message. Raises `InvalidArgumentError` for what is none of its kinds."""
    match value:
{made}    raise convert.no_kind(value, "{name}")


def {name}_from_proto(message: {message}) -> {value.name}:
    """Reads a message. Raises `InvalidArgumentError` where no kind is set."""
    match message.WhichOneof("kind"):
{read}        case _:
            raise convert.not_set("{name}.kind")
'''


def _late(value: MessageValue) -> str:
    """The parts of a codec: how each field is read, and how those that change rarely are written."""
    kind, message = value.name, f"pb.{value.message}"
    readers = "".join(f'    "{each.attribute}": lambda message: {each.read},\n' for each in value.fields)
    rare = [each for each in value.fields if each.is_rare]
    told = "".join(f"        value.{each.attribute},\n" for each in rare)
    written = "".join(f"    {line}\n" for each in rare for line in _written(each))
    return f'''

{shouted(kind)}_READERS: Mapping[str, Callable[[{message}], object]] = {{
{readers}}}
"""Reader of each field."""


def rare_of_{value.codec}(value: {kind}) -> tuple[object, ...]:
    """Returns what `write_rare_of_{value.codec}` writes: while it is equal, that writes the same."""
    return (
{told}    )


def write_rare_of_{value.codec}(value: {kind}, message: {message}) -> None:
    """Writes what changes rarely into an empty message."""
{written}'''


def _written(each: Field) -> Iterator[str]:
    """Yields the statements that write a field."""
    attribute, part = f"value.{each.attribute}", f"message.{each.name}"
    made = each.write.removeprefix(f"None if {attribute} is None else ")
    if each.annotation.startswith(("tuple[", "frozenset[")):
        yield f"if {attribute}:"
        yield f"    {part}.extend({made})"
    elif made != each.write:
        yield f"if {attribute} is not None:"
        yield f"    {part}.CopyFrom({made})"
    elif each.annotation.endswith(" | None") and made == attribute:
        yield f"if {attribute} is not None:"
        yield f"    {part} = {made}"
    else:
        yield f"{part} = {made}"
