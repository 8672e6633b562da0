"""A recorded flight as a UAV (``--backend replay``). See ``docs/reference/backends/replay.md``."""

from ual_daemon.replay.settings import ReplaySettings
from ual_daemon.replay.vehicle import PlayedVehicle

__all__ = ["PlayedVehicle", "ReplaySettings"]
