"""Backend ``replay``: a recorded flight as a UAV. See ``docs/backends/replay.md``."""

from ual_daemon.backends.replay.backend import ReplayBackend
from ual_daemon.backends.replay.settings import ReplaySettings

__all__ = ["ReplayBackend", "ReplaySettings"]
