"""Writes ``ual/contract/methods.py``: the facts of each method, as a table without protobuf."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import Enum

from tools.contract.description import ContractService
from ual.contract.method import Method

_HEAD = '''"""The facts of each method of the contract. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from ual.access.roles import Role
from ual.contract.method import Kind, Method, Moves

'''
_LONGEST_CHARACTERS = 90
"""A longer text is written in parts."""


def source(services: Sequence[ContractService]) -> str:
    """Returns the module."""
    roles = "".join(f'    "ual.v1.{each.name}": {_code(each.role_of_unknown)},\n' for each in services)
    methods = "".join(f"    {_made(each)},\n" for service in services for each in service.methods)
    return (
        f"{_HEAD}ROLE_OF_UNKNOWN: Final[Mapping[str, Role]] = {{\n{roles}}}\n"
        '"""The role that a method needs which this version does not know, by the full name of its service."""\n\n'
        f"_METHODS = (\n{methods})\n"
        "METHODS: Final[Mapping[str, Method]] = {each.name: each for each in _METHODS}\n"
        '"""All methods of the contract, by their names, of which there are no two alike."""\n'
    )


def _made(method: Method) -> str:
    return f"Method({', '.join(_arguments(method))})"


def _arguments(method: Method) -> Iterator[str]:
    for name, value in method._asdict().items():
        if name not in Method._field_defaults:
            yield _code(value)
        elif value != Method._field_defaults[name]:
            yield f"{name}={_code(value)}"


def _code(value: object) -> str:
    if isinstance(value, Enum):
        return f"{type(value).__name__}.{value.name}"
    if isinstance(value, str) and len(value) > _LONGEST_CHARACTERS:
        middle = value.rindex(" ", 0, _LONGEST_CHARACTERS) + 1
        return f'"{value[:middle]}" "{value[middle:]}"'
    return f'"{value}"' if isinstance(value, str) else repr(value)
