"""The page of all settings: each key with its values and its default, from the types that the daemon checks with."""

from __future__ import annotations

import math
import types
import typing
from collections.abc import Iterator
from enum import Enum
from typing import Any

import msgspec

from ual_daemon.backends.airsim.settings import AirsimSettings
from ual_daemon.backends.crazyflie.settings import CrazyflieSettings
from ual_daemon.backends.dji.settings import DjiSettings
from ual_daemon.backends.light.settings import LightSettings
from ual_daemon.backends.mavlink.settings import MavlinkSettings
from ual_daemon.backends.mavros.settings import MavrosSettings
from ual_daemon.program.configuration import DaemonSettings
from ual_daemon.replay.settings import ReplaySettings
from ual_daemon.settings import VehicleSettings

_HEAD = """# All settings with their values and defaults

<!-- `make pages` writes this page from the types of the settings. -->

The keys of the configuration file. [Configuration](configuration.md) explains them, the pages of the backends theirs.
A dot leads into a section: `limits.climb_speed_m_s` is `climb_speed_m_s` within `limits`.
"""
_SECTIONS: tuple[tuple[str, str, type[msgspec.Struct]], ...] = (
    ("The daemon", "", DaemonSettings),
    ("The vehicle", "", VehicleSettings),
    ("Backend `light`", "light.", LightSettings),
    ("Backend `mavlink`", "mavlink.", MavlinkSettings),
    ("Backend `mavros`", "mavros.", MavrosSettings),
    ("Backend `crazyflie`", "crazyflie.", CrazyflieSettings),
    ("Backend `airsim`", "airsim.", AirsimSettings),
    ("Backend `dji`", "dji.", DjiSettings),
    ("Backend `replay`", "replay.", ReplaySettings),
)
_SIGNS = {"gt": "above", "ge": "from", "lt": "below", "le": "to"}


def page() -> str:
    """Returns the page."""
    parts = [_HEAD]
    for heading, prefix, section in _SECTIONS:
        rows = "".join(f"| `{key}` | {values} | {default} |\n" for key, values, default in _rows(section, prefix))
        parts.append(f"## {heading}\n\n| key | values | default |\n|---|---|---|\n{rows}")
    return "\n".join(parts)


def _rows(section: type[msgspec.Struct], prefix: str) -> Iterator[tuple[str, str, str]]:
    hints = typing.get_type_hints(section, include_extras=True)
    for each in msgspec.structs.fields(section):
        inner = _section_in(hints[each.name])
        is_list = typing.get_origin(_without_none(hints[each.name])) is tuple
        name = f"{prefix}{each.name}"
        if inner is None or is_list:
            yield name, f"a list of the keys below `{name}[]`" if inner else _values(hints[each.name]), _default(each)
        if inner is not None:
            yield from _rows(inner, f"{name}[]." if is_list else f"{name}.")


def _default(each: msgspec.structs.FieldInfo) -> str:
    if each.default is not msgspec.NODEFAULT:
        value = each.default
    elif each.default_factory is not msgspec.NODEFAULT:
        value = each.default_factory()
    else:
        return "required"
    if value is None or value == () or value == math.inf:
        return "none"
    plain = msgspec.to_builtins(value)
    if isinstance(plain, (list, tuple)) and plain and isinstance(plain[0], dict):
        return "one with its defaults"
    return f"`{msgspec.json.encode(plain).decode()}`"


def _without_none(hint: Any) -> Any:  # noqa: ANN401 (a type, or what stands for one in an annotation)
    options = [each for each in typing.get_args(hint) if each is not type(None)]
    return options[0] if typing.get_origin(hint) in (typing.Union, types.UnionType) and len(options) == 1 else hint


def _section_in(hint: Any) -> type[msgspec.Struct] | None:  # noqa: ANN401 (see above)
    if isinstance(hint, type) and issubclass(hint, msgspec.Struct):
        return hint
    return next((found for each in typing.get_args(hint) if (found := _section_in(each)) is not None), None)


def _values(hint: Any) -> str:  # noqa: ANN401 (see above)
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is typing.Annotated:
        limits = (each for each in arguments[1:] if isinstance(each, msgspec.Meta))
        words = " ".join(_limits(each) for each in limits)
        return f"{_values(arguments[0])} {words}".strip()
    if origin in (typing.Union, types.UnionType):
        return " or ".join(_values(each) for each in arguments if each is not type(None))
    if origin is typing.Literal:
        return ", ".join(f"`{each}`" for each in arguments)
    if origin is tuple:
        if arguments[-1:] == (Ellipsis,):
            return f"list of {_values(arguments[0])}"
        return f"list of {len(arguments)}: {_values(arguments[0])}"
    if isinstance(hint, type) and issubclass(hint, Enum):
        return ", ".join(f"`{each.value}`" for each in hint)
    return {float: "number", int: "whole number", str: "text", bool: "true or false"}.get(hint, "values")


def _limits(meta: msgspec.Meta) -> str:
    found = [f"{word} {value:g}" for name, word in _SIGNS.items() if (value := getattr(meta, name)) is not None]
    return " ".join(found)
