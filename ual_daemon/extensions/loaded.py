"""The extensions of one UAV: made, started and closed together."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ual.errors import NotSupportedError
from ual_daemon.extensions import registry
from ual_daemon.extensions.base import Extension, ExtensionContext, Service

_log = logging.getLogger(__name__)


class Extensions:
    """The extensions of one UAV, by name.

    Raises:
        ConfigError: One of them is not there, or its settings are wrong.

    """

    def __init__(self, sections: Mapping[str, Any], context: ExtensionContext) -> None:
        """`context` is that of all of them, without settings."""
        self._by_name: dict[str, Extension] = {}
        for name, section in sections.items():
            settings = registry.section(name, section)
            each = replace(context, settings=settings)
            self._by_name[name] = registry.make(name, each)

    @property
    def services(self) -> Sequence[Service]:
        """The services of all of them."""
        return [service for extension in self._by_name.values() for service in extension.services]

    def interface(self, name: str) -> object:
        """Returns what an extension offers in this process.

        Raises:
            NotSupportedError: It is not loaded.

        """
        if name not in self._by_name:
            loaded = ", ".join(self._by_name) or "none"
            raise NotSupportedError(f"the extension {name} is not loaded (loaded are: {loaded})", {"extension": name})
        return self._by_name[name].interface

    def start(self) -> None:
        """Begins, once the UAV is open. One that fails is logged, and the UAV flies without it."""
        for name, extension in self._by_name.items():
            try:
                extension.start()
            except Exception:  # noqa: BLE001  the flight must not depend on the packages of others
                _log.exception("the extension %s cannot begin", name)

    def close(self) -> None:
        """Ends all of them."""
        for name, extension in self._by_name.items():
            try:
                extension.close()
            except Exception:  # noqa: BLE001  as in `start`
                _log.exception("the extension %s has not ended well", name)
