"""The topics and services of MAVROS, within its node's name. They are the same in ROS 1 and ROS 2."""

from __future__ import annotations

from typing import NamedTuple

STATE = "state"
EXTENDED_STATE = "extended_state"
SYS_STATUS = "sys_status"
ESTIMATOR_STATUS = "estimator_status"
STATUS_TEXT = "statustext/recv"
STATUS_EVENT = "status_event"
POSE = "local_position/pose"
VELOCITY = "local_position/velocity_local"
IMU = "imu/data"
GLOBAL = "global_position/global"
ABOVE_HOME = "global_position/rel_alt"
ORIGIN = "global_position/gp_origin"
FIX = "global_position/raw/fix"
SATELLITES = "global_position/raw/satellites"
GPS_RAW = "gpsstatus/gps1/raw"
GPS_RTK = "gpsstatus/gps1/rtk"
GPS2_RTK = "gpsstatus/gps2/rtk"
VFR_HUD = "vfr_hud"
HOME = "home_position/home"
BATTERY = "battery"
RC_IN = "rc/in"
RC_OUT = "rc/out"
TIMESYNC = "timesync_status"
TARGET = "setpoint_raw/target_local"

MISSION = "mission/waypoints"
REACHED = "mission/reached"
FENCE = "geofence/waypoints"
RALLY = "rallypoint/waypoints"
CAPTURED = "camera/image_captured"
MOUNT = "mount_control/orientation"
GIMBAL = "gimbal_control/device/attitude_status"

SETPOINT, SETPOINT_TYPE = "setpoint_raw/local", "mavros_msgs/PositionTarget"

RTCM, RTCM_TYPE = "gps_rtk/send_rtcm", "mavros_msgs/RTCM"

COMMAND = "cmd/command"
COMMAND_INT = "cmd/command_int"
ARMING = "cmd/arming"
TAKE_OFF = "cmd/takeoff"
SET_MODE = "set_mode"
SET_INTERVAL = "set_message_interval"
VEHICLE_INFO = "vehicle_info_get"
GET_PARAMETER_ROS1 = "param/get"
GET_PARAMETERS_ROS2 = "param/get_parameters"
LIST_PARAMETERS_ROS2 = "param/list_parameters"
PULL_PARAMETERS = "param/pull"
SET_PARAMETER = "param/set"
SET_CURRENT = "mission/set_current"
GET_ON_SERVER = "/rosapi/get_param"
"""Reads from the parameter server of ROS 1."""


class MavrosTopic(NamedTuple):
    """A topic that is subscribed to. `queue_length` is how many messages may wait in the bridge."""

    kind: str
    throttle_ms: int = 0
    queue_length: int = 1
    is_required: bool = False
    """Whether nothing can be flown without it."""


TOPICS = {
    STATE: MavrosTopic("mavros_msgs/State", is_required=True),
    POSE: MavrosTopic("geometry_msgs/PoseStamped", is_required=True),
    VELOCITY: MavrosTopic("geometry_msgs/TwistStamped", is_required=True),
    EXTENDED_STATE: MavrosTopic("mavros_msgs/ExtendedState", is_required=True),
    SYS_STATUS: MavrosTopic("mavros_msgs/SysStatus", 100),
    ESTIMATOR_STATUS: MavrosTopic("mavros_msgs/EstimatorStatus", 100),
    STATUS_TEXT: MavrosTopic("mavros_msgs/StatusText", queue_length=20),
    STATUS_EVENT: MavrosTopic("mavros_msgs/StatusEvent", queue_length=20),
    IMU: MavrosTopic("sensor_msgs/Imu", 200),
    GLOBAL: MavrosTopic("sensor_msgs/NavSatFix", 150),
    ABOVE_HOME: MavrosTopic("std_msgs/Float64", 150),
    ORIGIN: MavrosTopic("geographic_msgs/GeoPointStamped"),
    FIX: MavrosTopic("sensor_msgs/NavSatFix", 300),
    SATELLITES: MavrosTopic("std_msgs/UInt32", 300),
    GPS_RAW: MavrosTopic("mavros_msgs/GPSRAW", 300),
    GPS_RTK: MavrosTopic("mavros_msgs/GPSRTK", 500),
    GPS2_RTK: MavrosTopic("mavros_msgs/GPSRTK", 500),
    VFR_HUD: MavrosTopic("mavros_msgs/VfrHud", 500),
    HOME: MavrosTopic("mavros_msgs/HomePosition"),
    BATTERY: MavrosTopic("sensor_msgs/BatteryState"),  # of all batteries, one after the other
    RC_IN: MavrosTopic("mavros_msgs/RCIn", 150),
    RC_OUT: MavrosTopic("mavros_msgs/RCOut", 300),
    TIMESYNC: MavrosTopic("mavros_msgs/TimesyncStatus", 50),
    TARGET: MavrosTopic("mavros_msgs/PositionTarget", 80),
    CAPTURED: MavrosTopic("mavros_msgs/CameraImageCaptured", queue_length=20),
    MOUNT: MavrosTopic("geometry_msgs/Quaternion", 100),
    GIMBAL: MavrosTopic("mavros_msgs/GimbalDeviceAttitudeStatus", 100),
    # Each new subscriber gets the last one of these, so they are no sign of life.
    MISSION: MavrosTopic("mavros_msgs/WaypointList", 100),
    REACHED: MavrosTopic("mavros_msgs/WaypointReached", 100),
    FENCE: MavrosTopic("mavros_msgs/WaypointList", 100),
    RALLY: MavrosTopic("mavros_msgs/WaypointList", 100),
}
