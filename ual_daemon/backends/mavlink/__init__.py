"""The MAVLink backend: PX4 and ArduPilot multirotors. See ``docs/reference/backends/mavlink.md``.

Data runs one way through the rooms, which import only downward (a contract in pyproject.toml checks it):

- ``backend``: the interface that the layers above call
- ``session``: the exchange with one autopilot over time, and the thread that receives
- ``autopilots``: what PX4 and ArduPilot do differently, as functions of the data
- ``wire``: bytes to checked messages, and messages to bytes
- ``links``: UDP, TCP and serial lines
- ``settings``

A received message passes links, wire (`Receiver`) and session (`MavlinkSession`, `AutopilotTelemetry`) once each, and
becomes part of the next snapshot. A setpoint passes backend, autopilots (`SetpointEncoder`), wire (`Sender`) and links,
on the caller's thread and past the session. ``autopilots`` lies above ``wire``, as it encodes and decodes the content
of messages, and below ``session``, as it remembers nothing but what it has learned of the vehicle (`FeedForward`). What
PX4 and ArduPilot are, apart from MAVLink, is in ``ual_daemon.backends.firmwares``.
"""

from ual_daemon.backends.mavlink.backend import MavlinkBackend

__all__ = ["MavlinkBackend"]
