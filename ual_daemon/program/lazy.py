"""Loads some modules of the standard library at their first use, although other modules import them at start.

asyncio imports ssl, and pymavlink imports hashlib; both load OpenSSL: 5 MiB for what a daemon hardly ever does. gRPC
has a TLS of its own, and only signed MAVLink needs hashes. docs/decisions/0019 says why this is worth a module.
"""

from __future__ import annotations

import sys
import threading
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType

_NAMES = ("hashlib", "ssl", "asyncio.sslproto")
"""`asyncio.sslproto` uses ssl as soon as it is imported. asyncio needs it only for connections with TLS."""

_lock = threading.RLock()


def prepare() -> None:
    """Puts a placeholder for each module that is not loaded yet. Call it before asyncio or pymavlink is imported."""
    for name in _NAMES:
        if name not in sys.modules:
            sys.modules[name] = later = _Later(name)
            vars(later)["__spec__"] = ModuleSpec(name, None)  # `importlib.util.find_spec` asks a loaded module for it


class _Later(ModuleType):
    """Stands for a module. The first use of an attribute loads the module and copies its attributes."""

    def __getattr__(self, attribute: str) -> object:
        _load(self)
        try:
            return vars(self)[attribute]
        except KeyError:
            raise AttributeError(f"module {self.__name__!r} has no attribute {attribute!r}") from None

    def __setattr__(self, attribute: str, value: object) -> None:
        """Sets the attribute in the module, too: other importers see the module."""
        setattr(_load(self), attribute, value)
        vars(self)[attribute] = value


def _load(later: _Later) -> ModuleType:
    """Returns the module that it stands for."""
    name = later.__name__
    with _lock:
        if sys.modules.get(name) is later:
            del sys.modules[name]
            vars(later).update(vars(import_module(name)))
        return import_module(name)
