"""The public names and signatures of UAL for Python, in tests/data/interface.txt: what installed programs rely on.

``python -m tests.interface`` (``make interface``) adds the names that are not recorded yet, and changes none.
``python -m tests.interface --documented`` prints all of them with their docstrings, to compare two revisions.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import sys
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import ual
import ual_daemon

RECORD = Path(__file__).parent / "data" / "interface.txt"
INTERNAL = (
    *("ual.v1", "ual.wire", "ual.shared", "ual.access", "ual.recording", "ual.discovery", "ual.contract"),
    "ual.conformance.",  # its modules: the package is public
)
"""Rooms that the three distributions share, which are no interface for programs (docs/concepts/architecture.md)."""
REMEDY = (
    "Installed programs would fail. Undo it. What cannot stay is deprecated first (docs/reference/compatibility.md); "
    f"once it may go, delete its line in {RECORD.name}."
)


class Name(NamedTuple):
    """A public name: what it is called, how it is called, and what its docstring says."""

    name: str
    signature: str
    documentation: str


def recorded() -> dict[str, str]:
    """Returns the signatures that programs rely on, by name."""
    lines = RECORD.read_text(encoding="utf-8").splitlines() if RECORD.exists() else []
    return dict(line.split(" ", 1) for line in lines)


def found() -> dict[str, Name]:
    """Returns the public names as they are now."""
    return {each.name: each for module in _modules() for each in _of_module(module)}


def _modules() -> Iterator[ModuleType]:
    yield ual
    for module in pkgutil.walk_packages(ual.__path__, "ual."):
        if not module.name.startswith(INTERNAL) and "._" not in module.name and "__main__" not in module.name:
            yield importlib.import_module(module.name)
    yield ual_daemon


def _of_module(module: ModuleType) -> Iterator[Name]:
    listed = getattr(module, "__all__", None)
    for name in sorted(listed or vars(module)):
        value = getattr(module, name)
        is_own = getattr(value, "__module__", module.__name__) == module.__name__
        if listed or (not name.startswith("_") and is_own and not isinstance(value, ModuleType)):
            yield from _of_value(f"{module.__name__}.{name}", value)


def _of_value(name: str, value: Any) -> Iterator[Name]:
    if isinstance(value, type):
        yield Name(name, _of_class(value), inspect.getdoc(value) or "")
        yield from _members(name, value)
    elif callable(value) and hasattr(value, "__name__"):
        yield Name(name, _signature(value), inspect.getdoc(value) or "")
    else:
        yield Name(name, type(value).__name__, "")


def _members(name: str, owner: type) -> Iterator[Name]:
    ours = [each for each in owner.__mro__ if each.__module__.partition(".")[0] in ("ual", "ual_daemon")]
    for member in sorted({member for each in ours for member in vars(each) if not member.startswith("_")}):
        value = inspect.getattr_static(owner, member)
        if isinstance(value, Enum):
            yield Name(f"{name}.{member}", repr(value.value), "")
        elif isinstance(value, property):
            yield Name(f"{name}.{member}", _returned(value.fget), inspect.getdoc(value) or "")
        elif isinstance(value, (staticmethod, classmethod)) or inspect.isfunction(value):
            function = value if inspect.isfunction(value) else value.__func__
            yield Name(f"{name}.{member}", _signature(function), inspect.getdoc(getattr(owner, member)) or "")
        else:
            yield Name(f"{name}.{member}", "attribute", "")


def _of_class(owner: type) -> str:
    bases = ", ".join(each.__name__ for each in owner.__mro__[1:] if _is_public(each))
    is_made = not issubclass(owner, Enum) and owner.__init__ is not object.__init__
    return f"class({bases}) {_signature(owner) if is_made else ''}".strip()


def _is_public(base: type) -> bool:
    """Returns whether programs may ask for a base: no base that only shares code."""
    return base.__module__.startswith("ual") and "._" not in base.__module__ and not base.__name__.startswith("_")


def _returned(getter: Any) -> str:
    return f"property -> {_annotation(inspect.signature(getter).return_annotation)}"


def _signature(function: Any) -> str:
    try:
        signature = inspect.signature(function)
    except ValueError:  # of a class of Python's own
        return "(...)"
    parts, previous = [], None
    for each in signature.parameters.values():
        if each.kind is each.KEYWORD_ONLY and previous not in (each.KEYWORD_ONLY, each.VAR_POSITIONAL):
            parts.append("*")
        parts.append(_parameter(each))
        previous = each.kind
    returned = signature.return_annotation
    return f"({', '.join(parts)})" + ("" if returned is signature.empty else f" -> {_annotation(returned)}")


def _parameter(parameter: inspect.Parameter) -> str:
    stars = "*" * (parameter.kind is parameter.VAR_POSITIONAL) + "**" * (parameter.kind is parameter.VAR_KEYWORD)
    annotation = "" if parameter.annotation is parameter.empty else f": {_annotation(parameter.annotation)}"
    default = "" if parameter.default is parameter.empty else f" = {_default(parameter.default)}"
    return f"{stars}{parameter.name}{annotation}{default}"


def _default(value: object) -> str:
    if isinstance(value, Enum):
        return f"{type(value).__name__}.{value.name}"
    text = repr(value)
    return "..." if " at 0x" in text or text.startswith("<") else text


def _annotation(annotation: Any) -> str:
    return annotation if isinstance(annotation, str) else inspect.formatannotation(annotation)


def main() -> None:
    """Prints all names, or adds those that are new to the record."""
    if "--documented" in sys.argv:
        for each in found().values():
            print(f"{each.name} {each.signature}\n{each.documentation}\n")
        return
    names = {name: each.signature for name, each in found().items()} | recorded()
    RECORD.write_text("".join(f"{name} {names[name]}\n" for name in sorted(names)), encoding="utf-8")


if __name__ == "__main__":
    main()
