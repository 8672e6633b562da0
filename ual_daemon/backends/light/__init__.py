"""The light simulation: kinematic multirotors with an autopilot, a battery, GPS, a safety pilot and faults."""

from ual_daemon.backends.light.backend import LightBackend
from ual_daemon.backends.light.settings import LightSettings
from ual_daemon.backends.light.world import World

__all__ = ["LightBackend", "LightSettings", "World"]
