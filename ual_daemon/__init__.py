"""The UAV abstraction layer's daemon and its class interface: `from ual_daemon import UAL`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ual_daemon.version import __version__

if TYPE_CHECKING:
    from ual_daemon.ual import UAL

__all__ = ["UAL", "__version__"]


def __getattr__(name: str) -> object:
    """Imports the class when it is asked for: programs that need only a part start faster."""
    if name == "UAL":
        from ual_daemon.ual import UAL

        return UAL
    raise AttributeError(name)
