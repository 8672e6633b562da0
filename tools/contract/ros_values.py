"""The values of Python that stand for the contract's messages, and the types of their attributes."""

from __future__ import annotations

import importlib
import inspect
import types
import typing
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

from google.protobuf.descriptor import Descriptor, EnumDescriptor

import ual.interface

MODULES = {
    "camera": ("ual.cameras",),
    "fence": ("ual.fences.values",),
    "gimbal": ("ual.gimbals",),
    "logs": ("ual.logs.values",),
    "mission": ("ual.missions.items", "ual.missions.plan"),
    "parameters": ("ual.parameters.values",),
    "ual": ("ual.types", "ual.geometry"),
}
"""Modules with the values of a file of the contract, where they are not the module of its name."""
NOT_GIVEN = ("blocking", "timeout_s")
"""Arguments of `ual.Uav` that say how a call waits."""
_OTHER_NAMES = {"GetInfoResponse": "Info", "HoldItem": "HoldTime", "MissionItem": "Item"}


@dataclass(frozen=True)
class Hint:
    """Type of an attribute or an argument: whether it may be None, whether there are several, and of which type."""

    is_optional: bool
    container: type | None
    inner: Any

    @classmethod
    def of(cls, hint: Any) -> Hint:  # noqa: ANN401 (any type)
        """Reads an annotation."""
        is_optional = False
        if isinstance(hint, types.UnionType) or typing.get_origin(hint) is typing.Union:
            rest = [each for each in typing.get_args(hint) if each is not type(None)]
            is_optional, hint = len(rest) < len(typing.get_args(hint)), rest[0]
        origin = typing.get_origin(hint)
        if isinstance(origin, type):
            return cls(is_optional, origin, typing.get_args(hint)[0])
        return cls(is_optional, None, hint)


def kind_of(descriptor: Descriptor | EnumDescriptor) -> str:
    """Returns the class of a message or an enum, as ``ual.gripper.WinchStatus``.

    Raises:
        SystemExit: There is none.

    """
    name = descriptor.name
    stem = descriptor.file.name.rpartition("/")[2].removesuffix(".proto")
    wanted = (_OTHER_NAMES.get(name, name), f"{name}Info", name.removesuffix("Item"))
    modules = MODULES.get(stem, (f"ual.{stem}",))
    for module in modules:
        for each in wanted:
            if hasattr(importlib.import_module(module), each):
                return f"{module}.{each}"
    raise SystemExit(f"no class of {', '.join(modules)} stands for {name}")


@cache
def hints_of(kind: str) -> dict[str, Hint]:
    """Returns the attributes of a class that `kind_of` has returned."""
    found = typing.get_type_hints(_class(kind))
    return {attribute: Hint.of(hint) for attribute, hint in found.items()}


def members_of(kind: str) -> list[str]:
    """Returns the names of an enum's members, but for one that stands for what is not named."""
    return [each.name for each in _class(kind) if each.value]


def zero_of(kind: str) -> str | None:
    """Returns the name of an enum's member that stands for what is not named; None where there is none."""
    return next((each.name for each in _class(kind) if not each.value), None)


def _class(kind: str) -> Any:  # noqa: ANN401 (a class)
    module, _, name = kind.rpartition(".")
    return getattr(importlib.import_module(module), name)


@cache
def arguments_of(interface: str, member: str) -> dict[str, Hint]:
    """Returns the arguments of a member of ``ual.interface``.

    Raises:
        SystemExit: There is no such member.

    """
    found: Callable[..., object] | None = getattr(getattr(ual.interface, interface), member, None)
    if found is None:
        raise SystemExit(f"ual.interface.{interface} has no {member}")
    hints = typing.get_type_hints(found)
    names = [name for name in inspect.signature(found).parameters if name not in ("self", *NOT_GIVEN)]
    return {name: Hint.of(hints[name]) for name in names}
