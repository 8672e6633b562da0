"""Names of a package whose modules are imported when a name is first used."""

from __future__ import annotations

import importlib
from collections.abc import Callable


def late(package: str, module: str, *names: str) -> Callable[[str], object]:
    """Returns the `__getattr__` of a package: these names are those of one of its modules."""

    def get(name: str) -> object:
        if name in names:
            return getattr(importlib.import_module(f"{package}.{module}"), name)
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    return get
