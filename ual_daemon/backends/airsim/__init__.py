"""AirSim, Cosys-AirSim and Colosseum: simulators in Unreal Engine, whose multirotors fly by `simple_flight`."""

from ual_daemon.backends.airsim.backend import AirsimBackend
from ual_daemon.backends.airsim.settings import AirsimSettings

__all__ = ["AirsimBackend", "AirsimSettings"]
