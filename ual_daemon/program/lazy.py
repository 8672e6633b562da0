"""Modules of the standard library that load when they are used first, although others import them at once.

asyncio imports ssl, and pymavlink hashlib, and with them OpenSSL: 4 MiB and 10 ms of the start for what a daemon hardly
ever does. gRPC has a TLS of its own, and hashes are taken of signed MAVLink only.
"""

from __future__ import annotations

import sys
import threading
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType

_NAMES = ("hashlib", "ssl", "asyncio.sslproto")
"""The last one uses ssl as soon as it is imported; asyncio uses it for connections with TLS."""

_lock = threading.RLock()


def prepare() -> None:
    """To be called before anything imports asyncio or pymavlink. What is loaded already stays as it is."""
    for name in _NAMES:
        if name not in sys.modules:
            sys.modules[name] = later = _Later(name)
            vars(later)["__spec__"] = ModuleSpec(name, None)  # as `find_spec` gives it for what is loaded


class _Later(ModuleType):
    """Stands for a module until one of its attributes is asked for, and then shows what is in the module."""

    def __getattr__(self, attribute: str) -> object:
        _load(self)
        try:
            return vars(self)[attribute]
        except KeyError:
            raise AttributeError(f"module {self.__name__!r} has no attribute {attribute!r}") from None

    def __setattr__(self, attribute: str, value: object) -> None:
        """Sets it in the module, too, which is what everybody else sees."""
        setattr(_load(self), attribute, value)
        vars(self)[attribute] = value


def _load(later: _Later) -> ModuleType:
    """The module that it stands for."""
    name = later.__name__
    with _lock:
        if sys.modules.get(name) is later:
            del sys.modules[name]
            vars(later).update(vars(import_module(name)))
        return import_module(name)
