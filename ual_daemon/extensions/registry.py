"""Finds extensions by name: those of installed packages, by entry points (``ual_daemon.extensions``)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from ual_daemon.extensions.base import Extension, ExtensionContext
from ual_daemon.settings import ConfigError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "ual_daemon.extensions"


def entry_points() -> Iterable[EntryPoint]:
    """Returns the entry points of installed packages."""
    from importlib import metadata

    return metadata.entry_points(group=GROUP)


def make(name: str, context: ExtensionContext) -> Extension:
    """Makes an extension by its name.

    Raises:
        ConfigError: There is none of this name, it cannot be imported, or its settings are not valid.

    """
    key = f"extensions.{name}"
    found = next((point for point in entry_points() if point.name == name), None)
    if found is None:
        known = ", ".join(sorted(point.name for point in entry_points())) or "none"
        raise ConfigError(f"there is no extension of this name; installed are: {known}", key)
    try:
        kind = found.load()
    except ImportError as error:
        raise ConfigError(f"it cannot be loaded: {error}", key) from error
    if not (isinstance(kind, type) and issubclass(kind, Extension)):
        raise ConfigError(f"{found.value} is not a ual_daemon.extensions.Extension", key)
    try:
        return kind(context)
    except ConfigError as error:
        raise ConfigError(error.message, f"{key}.{error.key}") from None


def section(name: str, value: object) -> Mapping[str, Any]:
    """Returns the settings of an extension; an empty section is one without settings.

    Raises:
        ConfigError: It is no section.

    """
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise ConfigError(f"expected the settings of the extension, got {value!r:.60}", f"extensions.{name}")
    return value
