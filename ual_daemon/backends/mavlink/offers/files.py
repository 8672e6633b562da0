"""Whether an autopilot has MAVFTP."""

from __future__ import annotations

from ual_daemon.backends.mavlink.session.session import MavlinkSession
from ual_daemon.backends.mavlink.wire.messages import mavlink


def has_files(session: MavlinkSession) -> bool:
    """Returns whether the autopilot says that it has MAVFTP."""
    version = session.telemetry.version
    return version is not None and bool(version.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_FTP)
