"""Writes the modules of ``ual/contract``: enums and dataclasses, documented by the comments of the contract."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from tools.contract.compiled import ROOT
from tools.contract.values import EnumValue, MessageValue, Values
from tools.contract.words import docstring

BASES = ROOT / "clients" / "python" / "ual" / "contract" / "bases.py"
"""What values do beside holding their fields, by hand: the class ``XBase`` is a base of the value ``X``."""


def source(values: Values) -> str:
    """Returns the module."""
    bases = _bases(BASES)
    messages = [each for each in values.messages.values() if not each.is_tuple]
    body = "".join(map(_enum, values.enums.values())) + "".join(_dataclass(each, bases) for each in messages)
    return (
        f'"""The values of ``{values.file}.proto``. ``make proto`` writes this file: do not edit it."""\n\n'
        "from __future__ import annotations\n\n"
        f"{''.join(_imports(values, messages, bases))}\n{body}"
    )


def _bases(path: Path) -> set[str]:
    return {node.name for node in ast.parse(path.read_text(encoding="utf-8")).body if isinstance(node, ast.ClassDef)}


def _imports(values: Values, messages: list[MessageValue], bases: set[str]) -> Iterator[str]:
    if messages:
        yield "from dataclasses import dataclass\n"
    if values.enums:
        yield "from enum import Enum\n"
    for module, name in sorted(
        {(module, name) for each in messages for part in each.fields for name, module in part.modules.items()}
    ):
        yield f"from {module} import {name}\n"
    used = sorted(f"{each.name}Base" for each in messages if f"{each.name}Base" in bases)
    if used:
        yield f"from ual.contract.bases import {', '.join(used)}\n"


def _enum(enum: EnumValue) -> str:
    members = "".join(
        f"    {name} = {number}\n{docstring(text) if text else ''}" for name, number, text in enum.members
    )
    return f"\n\nclass {enum.name}(Enum):\n{docstring(enum.text)}\n{members}"


def _dataclass(value: MessageValue, bases: set[str]) -> str:
    base = f"({value.name}Base)" if f"{value.name}Base" in bases else ""
    about = docstring(value.text, {each.attribute: each.text for each in value.fields})
    fields = "".join(
        f"    {each.attribute}: {each.annotation}{'' if index < value.given else f' = {each.default}'}\n"
        for index, each in enumerate(value.fields)
    )
    return f"\n\n@dataclass(frozen=True, slots=True)\nclass {value.name}{base}:\n{about}\n{fields}"
