"""The fields of MAVROS' messages, as UAL's values. Axes and units are ours already (REP 103): nothing is converted."""

from __future__ import annotations

import math
import re

from ual.geometry import Pose, Twist, Vector3
from ual.types import Battery, GpsFix, GpsInfo
from ual_daemon.backends.firmwares.autopilot import Autopilot
from ual_daemon.backends.firmwares.numbers import (
    ACCELERATED_VELOCITY_MASK,
    LOCAL_NED,
    POSITION_MASK,
    UNACCELERATED_MASK,
    VELOCITY_MASK,
    EstimatorFlag,
)
from ual_daemon.backends.rosbridge import Message
from ual_daemon.backends.rosbridge.fields import number, numbers, quaternion, vector
from ual_daemon.backends.values import LandedState, Mode, PositionSetpoint, Setpoint

_MOST_ID_DIGITS = 3
"""Of the id of a battery."""
_LANDED = {
    1: LandedState.ON_GROUND,
    2: LandedState.IN_AIR,
    3: LandedState.TAKING_OFF,
    4: LandedState.LANDING,
}
_FIX = {
    2: GpsFix.FIX_2D,
    3: GpsFix.FIX_3D,
    4: GpsFix.DIFFERENTIAL,
    5: GpsFix.RTK_FLOAT,
    6: GpsFix.RTK_FIXED,
    7: GpsFix.FIX_3D,
    8: GpsFix.FIX_3D,
}
_UNNAMED_MODE = re.compile(r"CMODE\((\d+)\)")
_DIAGONAL_COVARIANCE_TYPE = 3
_UNKNOWN_U8_CODE = 255


def mode(name: str, autopilot: Autopilot) -> Mode:
    """Returns the mode by the name that MAVROS gives it; one that MAVROS does not know comes as ``CMODE(number)``."""
    unnamed = _UNNAMED_MODE.fullmatch(name)
    return autopilot.mode_named(name) if unnamed is None else autopilot.mode(int(unnamed[1]))


def landed_state(message: Message) -> LandedState:
    """Returns the landed state of an ExtendedState."""
    return _LANDED.get(int(message["landed_state"]), LandedState.UNKNOWN)


def estimator_flags(message: Message) -> int:
    """Returns the flags of an EstimatorStatus, as the autopilot sent them."""
    return sum(int(flag) for flag in EstimatorFlag if message.get(f"{str(flag.name).lower()}_status_flag"))


def pose(message: Message) -> Pose:
    """Returns the pose of a PoseStamped."""
    found = message["pose"]
    return Pose(vector(found["position"]), quaternion(found["orientation"]))


def twist(message: Message, of: Pose) -> Twist:
    """Returns the velocity of ``velocity_local``, of a vehicle with a pose.

    MAVROS turns the angular velocity there into the local axes, too, though the header names the body's frame.
    """
    found = message["twist"]
    return Twist(vector(found["linear"]), of.orientation.inverse().rotate(vector(found["angular"])))


def battery(message: Message) -> Battery:
    """Returns a BatteryState: its current is negative while it discharges, and -1 % means not known."""
    voltage_v, current_a, share = (number(message[name]) for name in ("voltage", "current", "percentage"))
    return Battery(
        remaining_percent=100.0 * share if 0.0 <= share <= 1.0 else None,
        voltage_v=voltage_v if 0.0 < voltage_v < 65.0 else None,
        current_a=-current_a if current_a <= 0.0 else None,
        id=_battery_id(str(message.get("location", ""))),
    )


def _battery_id(location: str) -> int:
    """Returns the id in MAVROS' ``id0``, the first one's where it says none."""
    number_text = location.removeprefix("id")
    return int(number_text) if number_text.isdecimal() and len(number_text) <= _MOST_ID_DIGITS else 0


def gps_info(fix: Message, raw: Message | None, satellites_count: int) -> GpsInfo:
    """Returns the fix of a NavSatFix; its kind by a GPSRAW, where that comes."""
    has_fix = int(fix["status"]["status"]) >= 0
    kind = GpsFix.FIX_3D if has_fix else GpsFix.NONE
    if raw is not None:
        kind = _FIX.get(int(raw["fix_type"]), GpsFix.NONE)
    horizontal_m, vertical_m = _accuracies_m(fix)
    return GpsInfo(
        kind,
        satellites_count=None if satellites_count in (0, _UNKNOWN_U8_CODE) else satellites_count,
        horizontal_accuracy_m=horizontal_m,
        vertical_accuracy_m=vertical_m,
    )


def _accuracies_m(fix: Message) -> tuple[float | None, float | None]:
    if fix["position_covariance_type"] != _DIAGONAL_COVARIANCE_TYPE:
        return None, None
    covariance = numbers(fix["position_covariance"])
    return math.sqrt(max(0.0, covariance[0])), math.sqrt(max(0.0, covariance[8]))


def position_target(setpoint: Setpoint, *, with_acceleration: bool) -> Message:
    """Returns the PositionTarget of a setpoint. MAVROS turns it to north, east, down, and the heading with it.

    The header is left out: autopilots do not use the time.
    """
    message = {
        "coordinate_frame": LOCAL_NED,
        "type_mask": VELOCITY_MASK,
        "velocity": _xyz(setpoint.velocity),
        "yaw_rate": setpoint.yaw_rate_rad_s,
    }
    if isinstance(setpoint, PositionSetpoint):
        message["type_mask"] = POSITION_MASK if with_acceleration else UNACCELERATED_MASK
        message["position"] = _xyz(setpoint.position)
        message["yaw"] = setpoint.yaw_rad
        if with_acceleration:
            message["acceleration_or_force"] = _xyz(setpoint.acceleration)
    elif setpoint.acceleration is not None:
        message["type_mask"] = ACCELERATED_VELOCITY_MASK
        message["acceleration_or_force"] = _xyz(setpoint.acceleration)
    return message


def _xyz(of: Vector3) -> Message:
    return {"x": of.x, "y": of.y, "z": of.z}
