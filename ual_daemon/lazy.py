"""Modules of the standard library that load when they are used first, although others import them at once.

asyncio imports ssl, and pymavlink hashlib, and with them OpenSSL: 4 MiB and 10 ms of the start for what a daemon hardly
ever does. gRPC has a TLS of its own, and hashes are taken of signed MAVLink only.
"""

from __future__ import annotations

import sys
import threading
from importlib import import_module
from types import ModuleType

_NAMES = ("hashlib", "ssl", "asyncio.sslproto")
"""The last one uses ssl as soon as it is imported; asyncio uses it for connections with TLS."""

_lock = threading.RLock()


def prepare() -> None:
    """To be called before anything imports asyncio or pymavlink. What is loaded already stays as it is."""
    for name in _NAMES:
        if name not in sys.modules:
            sys.modules[name] = _Later(name)


class _Later(ModuleType):
    """Stands for a module until one of its attributes is asked for, and then shows what is in the module."""

    def __getattr__(self, attribute: str) -> object:
        name = self.__name__
        with _lock:
            if sys.modules.get(name) is self:
                del sys.modules[name]
                vars(self).update(vars(import_module(name)))
        try:
            return vars(self)[attribute]
        except KeyError:
            raise AttributeError(f"module {name!r} has no attribute {attribute!r}") from None
