"""Numbers that PX4, ArduPilot and all protocols to them share: those of MAVLink's enumerations."""

from __future__ import annotations

from enum import IntEnum, IntFlag


class Firmware(IntEnum):
    """MAV_AUTOPILOT."""

    ARDUPILOT = 3
    PX4 = 12


class VehicleType(IntEnum):
    """MAV_TYPE: the multirotors. Others need other setpoints, and ArduPilot's have the same numbers for other modes."""

    QUADROTOR = 2
    COAXIAL = 3
    HEXAROTOR = 13
    OCTOROTOR = 14
    TRICOPTER = 15
    DODECAROTOR = 29
    DECAROTOR = 35


class VtolState(IntEnum):
    """MAV_VTOL_STATE."""

    UNDEFINED = 0
    MULTIROTOR = 3


class SystemStatus(IntEnum):
    """MAV_STATE."""

    BOOT = 1
    CRITICAL = 5
    FLIGHT_TERMINATION = 8


class EstimatorFlag(IntFlag):
    """ESTIMATOR_STATUS_FLAGS, which ArduPilot's EKF_STATUS_FLAGS follow."""

    ATTITUDE = 1
    VELOCITY_HORIZ = 2
    VELOCITY_VERT = 4
    POS_HORIZ_REL = 8
    POS_VERT_ABS = 32
    CONST_POS_MODE = 128


class Sensor(IntFlag):
    """MAV_SYS_STATUS_SENSOR: those that mean something to UAL."""

    OPTICAL_FLOW = 1 << 6
    VISION_POSITION = 1 << 7
    LASER_POSITION = 1 << 8
    RC_RECEIVER = 1 << 16
    GEOFENCE = 1 << 20
    AHRS = 1 << 21
    BATTERY = 1 << 25
    PREARM_CHECK = 1 << 28


_SENSOR_NAMES = (
    """
3d gyro|3d accel|3d mag|absolute pressure|differential pressure|gps|optical flow|vision position|laser position
external ground truth|angular rate control|attitude stabilization|yaw position|z altitude control|xy position control
motor outputs|rc receiver|3d gyro2|3d accel2|3d mag2|geofence|ahrs|terrain|reverse motor|logging|battery|proximity
satcom|prearm check|obstacle avoidance|propulsion|extension used
""".strip()
    .replace("\n", "|")
    .split("|")
)


def sensor_names(sensors: int) -> list[str]:
    """Returns the names of sensors by their bits, but not of the check before arming."""
    sensors &= ~int(Sensor.PREARM_CHECK)
    return [name for bit, name in enumerate(_SENSOR_NAMES) if sensors >> bit & 1]


_IGNORE_POSITION_BITS = 0b111
_IGNORE_ACCELERATION_BITS = 0b111 << 6
_IGNORE_YAW_BIT = 1 << 10
IGNORES_POSITION = _IGNORE_POSITION_BITS
"""The bits of a type mask that say that a target has no position."""
POSITION_MASK = 0
"""The type mask of a position target (POSITION_TARGET_TYPEMASK) with everything. A bit that is set ignores a field;
ArduPilot drops a group of which one bit is set, and restarts GUIDED at each combination that it does not know."""
UNACCELERATED_MASK = _IGNORE_ACCELERATION_BITS
"""The same without the acceleration."""
VELOCITY_MASK = _IGNORE_POSITION_BITS | _IGNORE_ACCELERATION_BITS | _IGNORE_YAW_BIT
"""Velocity and yaw rate."""
ACCELERATED_VELOCITY_MASK = _IGNORE_POSITION_BITS | _IGNORE_YAW_BIT
"""The same with an acceleration."""

LOCAL_NED = 1
"""MAV_FRAME_LOCAL_NED: the coordinate frame of setpoints that begins at the origin of the local frame."""
