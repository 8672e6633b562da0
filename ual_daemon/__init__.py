"""The UAV abstraction layer's daemon and its class interface: `from ual_daemon import UAL`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ual_daemon._version import __version__

if TYPE_CHECKING:
    from ual_daemon.ual import UAL

__all__ = ["UAL", "__version__"]


if not TYPE_CHECKING:  # a type checker would take any name for one of ours

    def __getattr__(name: str) -> object:
        """Imports the class on first use, so that programs that need only a part start faster."""
        if name == "UAL":
            from ual_daemon.ual import UAL

            return UAL
        raise AttributeError(f"module 'ual_daemon' has no attribute {name!r}")


def __dir__() -> list[str]:
    return list(__all__)
