"""Writes the modules of ``ual/wire`` that make messages of the values of a file, and read them."""

from __future__ import annotations

from tools.contract.values import EnumValue, MessageValue, Values
from tools.contract.words import snake

_BY_HAND = ("convert", "mission_items", "rally_points")
"""The modules of codecs by hand."""


def source(values: Values) -> str:
    """Returns the module."""
    asked = "".join(_argument(values.enums[name]) for name in sorted(values.in_requests))
    functions = asked + "".join(map(_codec, values.messages.values()))
    body = "".join(_table(each) for each in values.enums.values() if each.table in functions) + functions
    return f"{_head(values, body)}{body}"


def _head(values: Values, body: str) -> str:
    classes = [each.name for each in values.enums.values()] + [each.name for each in values.messages.values()]
    used = sorted({name for name in classes if name in body and not _is_tuple(values, name)})
    return (
        f'"""Between the messages of ``{values.file}.proto`` and their values. ``make proto`` writes this file: do not '
        'edit it."""\n\nfrom __future__ import annotations\n\n'
        + "from collections.abc import Mapping\n\n" * ("Mapping[" in body)
        + f"from {values.module} import {', '.join(used)}\n"
        + f"from ual.v1 import {values.file}_pb2 as pb\n"
        + "".join(f"from ual.wire import {each}\n" for each in _BY_HAND if f"{each}." in body)
        + "from ual.wire.enums import member_of, number_of\n" * ("number_of(" in body)
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
    private = value.is_tuple
    made = "".join(f"        {each.name}={each.write},\n" for each in value.fields)
    read = "".join(f"        {each.read},\n" for each in value.fields)
    unpacked = f"    {', '.join(each.attribute for each in value.fields)} = value\n" if value.is_tuple else ""
    if private:
        made = made.replace("value.", "")
    call = f"({read})" if value.is_tuple else f"{value.name}(\n{read})"
    return f'''

def {value.codec}_to_proto(value: {value.annotation}) -> pb.{value.message}:
    """Makes a message."""
{unpacked}    return pb.{value.message}(
{made}    )


def {value.codec}_from_proto(message: pb.{value.message}) -> {value.annotation}:
    """Reads a message."""
    return {call}
'''
