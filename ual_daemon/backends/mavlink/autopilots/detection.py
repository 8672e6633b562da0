"""Chooses the dialect of an autopilot."""

from __future__ import annotations

from ual_daemon.backends.mavlink.autopilots.ardupilot import ArduCopter
from ual_daemon.backends.mavlink.autopilots.dialect import MULTIROTORS, Dialect
from ual_daemon.backends.mavlink.autopilots.px4 import Px4
from ual_daemon.backends.mavlink.autopilots.unknown import Unknown
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink


def dialect_of(heartbeat: Message) -> Dialect:
    """Returns the dialect of the autopilot that sends this heartbeat."""
    autopilot, kind = heartbeat.autopilot, heartbeat.type
    if kind in MULTIROTORS and autopilot == mavlink.MAV_AUTOPILOT_PX4:
        return Px4()
    if kind in MULTIROTORS and autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA:
        return ArduCopter()
    return Unknown(autopilot, kind)
