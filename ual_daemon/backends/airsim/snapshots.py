"""Makes snapshots of what the simulator reports."""

from __future__ import annotations

from ual.types import GpsFix, GpsInfo
from ual_daemon.backends.airsim.link import Simulator
from ual_daemon.backends.airsim.state import AirsimReport
from ual_daemon.backends.values import (
    Cause,
    Condition,
    Control,
    ControlState,
    EarthReference,
    Estimator,
    LandedState,
    Mode,
    MotionState,
    Sample,
    Snapshot,
)
from ual_daemon.geodesy import EllipsoidProjection

API = Mode("API", Control.REFERENCES)
COLLISION = Mode("COLLISION", Control.OTHER, is_autonomous=True)
"""It hovers: no setpoints are sent to a vehicle that has hit something until control is taken again."""
HOVER = Mode("HOVER", Control.OTHER, is_autonomous=True)
"""It hovers by itself after `hold`: no setpoints are sent until control is taken again."""
REMOTE_CONTROL = Mode("REMOTE_CONTROL", Control.OTHER)
"""API control is off: the holder of the remote control flies, and without one the vehicle falls."""

_GPS = GpsInfo(GpsFix.FIX_3D)
"""`simple_flight` flies by the simulator's truth."""
_GOOD, _NO_POSE = Estimator(True), Estimator(False, "the simulator has no position of the vehicle")
_HELD_BY = {COLLISION.name: Cause.COLLISION, REMOTE_CONTROL.name: Cause.SAFETY_PILOT}


def projection_of(simulator: Simulator) -> EllipsoidProjection:
    """Returns the relation of the local frame to Earth: it begins at the vehicle's home."""
    home = simulator.home
    return EllipsoidProjection(home.latitude, home.longitude, home.altitude)


def make_snapshot(
    report: AirsimReport,
    heard_s: float,
    mode: Mode,
    landed: LandedState,
    projection: EllipsoidProjection,
    *,
    is_plausible: bool,
) -> Snapshot:
    """Returns what a report says that was received at `heard_s`. Its motion is left out where it cannot be true."""
    return Snapshot(
        time_s=heard_s,
        heard_s=heard_s,
        control=ControlState(
            armed=Sample(report.is_armed, heard_s),
            landed=Sample(landed, heard_s),
            mode=Sample(mode, heard_s),
            held_by=_HELD_BY.get(mode.name),
        ),
        motion=MotionState(
            stamp_s=report.time_s,
            measured_s=report.time_s,
            estimator=Sample(_GOOD if is_plausible else _NO_POSE, heard_s),
            pose=Sample(report.pose, heard_s) if is_plausible else None,
            velocity=Sample(report.velocity, heard_s) if is_plausible else None,
        ),
        earth=EarthReference(projection=projection, home_altitude_amsl_m=projection.altitude_amsl_m),
        condition=Condition(gps=_GPS),
    )
