"""The MAVLink backend: PX4 and ArduPilot multirotors. See ``docs/backends/mavlink.md``."""

from ual_daemon.backends.mavlink.backend import MavlinkBackend

__all__ = ["MavlinkBackend"]
