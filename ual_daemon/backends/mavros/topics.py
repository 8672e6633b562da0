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


class Topic(NamedTuple):
    """A topic that is subscribed to. `queue_length` is how many messages may wait in the bridge."""

    kind: str
    throttle_ms: int = 0
    queue_length: int = 1
    is_required: bool = False
    """Whether nothing can be flown without it."""


TOPICS = {
    STATE: Topic("mavros_msgs/State", is_required=True),
    POSE: Topic("geometry_msgs/PoseStamped", is_required=True),
    VELOCITY: Topic("geometry_msgs/TwistStamped", is_required=True),
    EXTENDED_STATE: Topic("mavros_msgs/ExtendedState", is_required=True),
    SYS_STATUS: Topic("mavros_msgs/SysStatus", 100),
    ESTIMATOR_STATUS: Topic("mavros_msgs/EstimatorStatus", 100),
    STATUS_TEXT: Topic("mavros_msgs/StatusText", queue_length=20),
    STATUS_EVENT: Topic("mavros_msgs/StatusEvent", queue_length=20),
    IMU: Topic("sensor_msgs/Imu", 200),
    GLOBAL: Topic("sensor_msgs/NavSatFix", 150),
    ABOVE_HOME: Topic("std_msgs/Float64", 150),
    ORIGIN: Topic("geographic_msgs/GeoPointStamped"),
    FIX: Topic("sensor_msgs/NavSatFix", 300),
    SATELLITES: Topic("std_msgs/UInt32", 300),
    GPS_RAW: Topic("mavros_msgs/GPSRAW", 300),
    GPS_RTK: Topic("mavros_msgs/GPSRTK", 500),
    GPS2_RTK: Topic("mavros_msgs/GPSRTK", 500),
    VFR_HUD: Topic("mavros_msgs/VfrHud", 500),
    HOME: Topic("mavros_msgs/HomePosition"),
    BATTERY: Topic("sensor_msgs/BatteryState"),  # of all batteries, one after the other
    RC_IN: Topic("mavros_msgs/RCIn", 150),
    RC_OUT: Topic("mavros_msgs/RCOut", 300),
    TIMESYNC: Topic("mavros_msgs/TimesyncStatus", 50),
    TARGET: Topic("mavros_msgs/PositionTarget", 80),
    CAPTURED: Topic("mavros_msgs/CameraImageCaptured", queue_length=20),
    MOUNT: Topic("geometry_msgs/Quaternion", 100),
    GIMBAL: Topic("mavros_msgs/GimbalDeviceAttitudeStatus", 100),
    # Each new subscriber gets the last one of these, so they are no sign of life.
    MISSION: Topic("mavros_msgs/WaypointList", 100),
    REACHED: Topic("mavros_msgs/WaypointReached", 100),
    FENCE: Topic("mavros_msgs/WaypointList", 100),
    RALLY: Topic("mavros_msgs/WaypointList", 100),
}
