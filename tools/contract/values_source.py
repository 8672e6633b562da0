"""Writes the modules of ``ual/contract``: enums and dataclasses, documented by the comments of the contract."""

from __future__ import annotations

from collections.abc import Iterator

from tools.contract.compiled import ROOT
from tools.contract.python_source import classes
from tools.contract.values import EnumValue, MessageValue, Values
from tools.contract.words import docstring

BASES = ROOT / "clients" / "python" / "ual" / "contract" / "_bases.py"
"""Bases of values, written by hand: the class ``XBase`` is a base of the value ``X``."""


def source(values: Values) -> str:
    """Returns the module."""
    bases = set(classes(BASES))
    messages = [each for each in values.messages.values() if not each.is_tuple]
    written = f"As values, from ``{values.file}.proto``. ``make proto`` writes this file: do not edit it."
    body = "".join(map(_enum, values.enums.values()))
    body += "".join(_choice(each) if each.variants else _dataclass(each, bases) for each in messages)
    return (
        docstring(f"{values.text.partition('. ')[0].rstrip('.')}. {written}", indent="") + "\n"
        "from __future__ import annotations\n\n"
        f"{''.join(_imports(values, messages, bases))}\n{body}"
    )


def _imports(values: Values, messages: list[MessageValue], bases: set[str]) -> Iterator[str]:
    parts = [part.modules for each in messages for part in each.fields]
    named = sorted({(module, name) for modules in parts for name, module in modules.items()})
    is_made = any("field(" in part.default for each in messages for part in each.fields)
    if any(not each.variants for each in messages):
        yield f"from dataclasses import dataclass{', field' * is_made}\n"
    kinds = {_base(each, bases) for each in values.enums.values()} & {"Enum", "IntEnum"}
    if kinds:
        yield f"from enum import {', '.join(sorted(kinds))}\n"
    yield from (f"from {module} import {name}\n" for module, name in named)
    made = [each.name for each in values.enums.values()] + [each.name for each in messages]
    if used := sorted(f"{name}Base" for name in made if f"{name}Base" in bases):
        yield f"from ual.contract._bases import {', '.join(used)}\n"


def _base(enum: EnumValue, bases: set[str]) -> str:
    base = f"{enum.name}Base"
    return base if base in bases else "IntEnum" if enum.is_rising else "Enum"


def _enum(enum: EnumValue) -> str:
    base = _base(enum, set(classes(BASES)))
    members = "".join(
        f"    {name} = {number}\n{docstring(text) if text else ''}" for name, number, text in enum.members
    )
    return f"\n\nclass {enum.name}({base}):\n{docstring(enum.text)}\n{members}"


def _dataclass(value: MessageValue, bases: set[str]) -> str:
    base = f"({value.name}Base)" if f"{value.name}Base" in bases else ""
    texts: dict[str, str] = {}
    for each in value.fields:
        declared, _, text = each.after.partition("  # ")
        texts |= {declared.partition(":")[0]: text, each.attribute: each.text}
    about = docstring(value.text, texts)
    fields = "".join(
        (f"    {each.after.partition('  # ')[0]}\n" if each.after else "")
        + f"    {each.attribute}: {each.annotation}{'' if index < value.given else f' = {each.default}'}\n"
        for index, each in enumerate(value.fields)
    )
    late = ", repr=False" * value.is_late
    return f"\n\n@dataclass(frozen=True, slots=True{late})\nclass {value.name}{base}:\n{about}\n{fields}"


def _choice(value: MessageValue) -> str:
    kinds = " | ".join(each.name for _, each in value.variants)
    return f"\n\n{value.name} = {kinds}\n"
