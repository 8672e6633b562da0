"""The wrappers of DJI's SDKs: their topics, types, services and numbers, as their sources have them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from typing_extensions import override

from ual_daemon.backends.rosbridge import Message
from ual_daemon.backends.values import VelocitySetpoint

JOY = "sensor_msgs/Joy"


class DjiTopic(NamedTuple):
    """A topic, its type, and which of `DjiTelemetry`'s methods takes it."""

    name: str
    kind: str
    handler: str
    is_required: bool = False
    """Whether it cannot be flown without it."""


class DjiCall(NamedTuple):
    """A service and its arguments. It may take `patience_s`: some answer only when what they began has ended."""

    service: str
    arguments: Message
    patience_s: float = 3.0
    blocks: bool = False
    """Whether the wrapper serves nothing else until it has answered."""


class Wrapper:
    """One wrapper."""

    name: str
    says_authority: bool
    """Whether it publishes the controller of the aircraft."""
    has_sea_level: bool = False
    """Whether altitudes above mean sea level have a topic of their own; else those of positions are such."""
    topics: tuple[DjiTopic, ...]
    setpoint_topic: str = ""
    """Topic for velocities; empty: they go to a service."""
    obtain: tuple[DjiCall, ...]
    release: DjiCall
    motors_on: DjiCall
    motors_off: DjiCall
    take_off: DjiCall
    land: DjiCall | None
    """None: UAL descends by velocities."""
    confirm_landing: DjiCall | None
    """None: no confirmation is given."""
    logger: str
    """Part of the names of its nodes in /rosout, where it logs what DJI's SDK answers."""
    has_cameras: bool = False
    """Whether UAL uses its modules for cameras and the gimbal."""
    payload_topics: tuple[DjiTopic, ...] = ()
    """Topics of the gimbal; each `handler` is one of `gimbals.DjiGimbal`."""
    reasons: str = ""
    """Human-readable source of DJI's reasons, where the wrapper does not pass them on."""
    battery_scale: float = 1.0
    """Turns its percentage into 0 to 1, its voltage into volts by `volt_scale`."""
    volt_scale: float = 1.0

    def topic_of(self, handler: str) -> str:
        """Returns the topic that a method of `DjiTelemetry` takes."""
        return next(topic.name for topic in self.topics if topic.handler == handler)

    def setpoint(self, setpoint: VelocitySetpoint) -> Message:
        """Returns the message (or the arguments of the service) of a velocity."""
        velocity = setpoint.velocity
        axes = [velocity.x, velocity.y, velocity.z, setpoint.yaw_rate_rad_s]
        return {"axes": axes, "buttons": []}


def _trigger(name: str) -> DjiCall:
    return DjiCall(f"psdk_ros2/{name}", {})


class PsdkRos2(Wrapper):
    """umdlife/psdk_ros2 on ROS 2: M300, M350, M30."""

    name = "psdk_ros2"
    says_authority = has_sea_level = True
    setpoint_topic = "psdk_ros2/flight_control_setpoint_ENUvelocity_yawrate"
    topics = (
        DjiTopic("psdk_ros2/attitude", "geometry_msgs/QuaternionStamped", "on_attitude", is_required=True),
        DjiTopic("psdk_ros2/velocity_ground_fused", "geometry_msgs/Vector3Stamped", "on_velocity", is_required=True),
        DjiTopic("psdk_ros2/angular_rate_ground_fused", "geometry_msgs/Vector3Stamped", "on_rates"),
        DjiTopic("psdk_ros2/gps_position_fused", "sensor_msgs/NavSatFix", "on_position", is_required=True),
        DjiTopic("psdk_ros2/altitude_sea_level", "std_msgs/Float32", "on_altitude", is_required=True),
        DjiTopic("psdk_ros2/rtk_position", "sensor_msgs/NavSatFix", "on_rtk_position"),
        DjiTopic("psdk_ros2/rtk_position_info", "std_msgs/UInt8", "on_rtk_info"),
        DjiTopic("psdk_ros2/gps_control_level", "std_msgs/UInt8", "on_gps_level", is_required=True),
        DjiTopic("psdk_ros2/flight_status", "psdk_interfaces/FlightStatus", "on_flight_status", is_required=True),
        DjiTopic("psdk_ros2/display_mode", "psdk_interfaces/DisplayMode", "on_display_mode", is_required=True),
        DjiTopic("psdk_ros2/control_mode", "psdk_interfaces/ControlMode", "on_control_mode", is_required=True),
        DjiTopic("psdk_ros2/rc_connection_status", "psdk_interfaces/RCConnectionStatus", "on_rc_connection"),
        DjiTopic("psdk_ros2/battery", "sensor_msgs/BatteryState", "on_battery"),
        DjiTopic("psdk_ros2/height_above_ground", "std_msgs/Float32", "on_height"),
        DjiTopic("psdk_ros2/home_point", "sensor_msgs/NavSatFix", "on_home"),
        DjiTopic("psdk_ros2/home_point_status", "std_msgs/Bool", "on_home_status"),
        DjiTopic("psdk_ros2/motor_start_error", "std_msgs/UInt16", "on_motor_error"),
        DjiTopic("psdk_ros2/relative_obstacle_info", "psdk_interfaces/RelativeObstacleInfo", "on_obstacles"),
        DjiTopic("/rosout", "rcl_interfaces/Log", "on_log"),
    )
    obtain = (_trigger("obtain_ctrl_authority"),)
    release = _trigger("release_ctrl_authority")
    motors_on = _trigger("turn_on_motors")
    motors_off = _trigger("turn_off_motors")
    take_off = _trigger("takeoff")
    land = _trigger("land")
    confirm_landing = _trigger("start_confirm_landing")
    logger = "flight_control"
    has_cameras = True
    payload_topics = (
        DjiTopic("psdk_ros2/gimbal_angles", "geometry_msgs/Vector3Stamped", "on_angles"),
        DjiTopic("psdk_ros2/gimbal_status", "psdk_interfaces/GimbalStatus", "on_status"),
    )


_CONSOLE = "DJI's reason is on the console of the node"
_OSDK_TOPICS = (
    DjiTopic("dji_osdk_ros/attitude", "geometry_msgs/QuaternionStamped", "on_attitude", is_required=True),
    DjiTopic("dji_osdk_ros/velocity", "geometry_msgs/Vector3Stamped", "on_velocity", is_required=True),
    DjiTopic("dji_osdk_ros/angular_velocity_fused", "geometry_msgs/Vector3Stamped", "on_body_rates"),
    DjiTopic("dji_osdk_ros/gps_position", "sensor_msgs/NavSatFix", "on_position", is_required=True),
    DjiTopic("dji_osdk_ros/rtk_position", "sensor_msgs/NavSatFix", "on_rtk_position"),
    DjiTopic("dji_osdk_ros/rtk_info_position", "std_msgs/UInt8", "on_rtk_info"),
    DjiTopic("dji_osdk_ros/gps_health", "std_msgs/UInt8", "on_gps_level", is_required=True),
    DjiTopic("dji_osdk_ros/flight_status", "std_msgs/UInt8", "on_flight_status", is_required=True),
    DjiTopic("dji_osdk_ros/display_mode", "std_msgs/UInt8", "on_display_mode", is_required=True),
    DjiTopic("dji_osdk_ros/battery_state", "sensor_msgs/BatteryState", "on_battery"),
    DjiTopic("dji_osdk_ros/height_above_takeoff", "std_msgs/Float32", "on_height"),
    DjiTopic("/rosout", "rosgraph_msgs/Log", "on_log"),
)


class OsdkVehicleNode(Wrapper):
    """dji-sdk/Onboard-SDK-ROS 4.1 on ROS 1, its node `dji_vehicle_node`: M210, M300.

    Its services do not begin with the name of the package. One thread serves them one after another, and its own
    landing (task 6) answers only when the aircraft stands. Meanwhile it would be impossible to confirm that landing, to
    release the authority or to send a velocity.
    """

    name = "dji_osdk_ros"
    says_authority = False
    topics = _OSDK_TOPICS
    obtain = (
        DjiCall("obtain_release_control_authority", {"enable_obtain": True}),
        DjiCall(
            "set_joystick_mode",
            {"horizontal_mode": 1, "vertical_mode": 0, "yaw_mode": 1, "horizontal_coordinate": 0, "stable_mode": 1},
        ),
    )
    release = DjiCall("obtain_release_control_authority", {"enable_obtain": False})
    motors_on = DjiCall("flight_task_control", {"task": 7})
    motors_off = DjiCall("flight_task_control", {"task": 8})
    take_off = DjiCall("flight_task_control", {"task": 4}, patience_s=30.0, blocks=True)
    land = confirm_landing = None
    joystick = "joystick_action"
    logger = "vehicle_node"
    reasons = _CONSOLE
    battery_scale, volt_scale = 0.01, 0.001

    @override
    def setpoint(self, setpoint: VelocitySetpoint) -> dict[str, Any]:
        """North, east, up in m/s, and degrees clockwise a second: DJI's own axes."""
        velocity, yaw = setpoint.velocity, -math.degrees(setpoint.yaw_rate_rad_s)
        return {"joystickCommand": {"x": velocity.y, "y": velocity.x, "z": velocity.z, "yaw": yaw}}


class OsdkSdkNode(Wrapper):
    """The older node of the same package, `dji_sdk_node`: A3, N3, M600, M210 V1. It takes velocities on a topic."""

    name = "dji_osdk_ros (dji_sdk_node)"
    says_authority = False
    topics = _OSDK_TOPICS
    setpoint_topic = "dji_osdk_ros/flight_control_setpoint_ENUvelocity_yawrate"
    obtain = (DjiCall("dji_osdk_ros/sdk_control_authority", {"control_enable": 1}),)
    release = DjiCall("dji_osdk_ros/sdk_control_authority", {"control_enable": 0})
    motors_on = DjiCall("dji_osdk_ros/drone_arm_control", {"arm": 1})
    motors_off = DjiCall("dji_osdk_ros/drone_arm_control", {"arm": 0})
    take_off = DjiCall("dji_osdk_ros/drone_task_control", {"task": 4})
    land = DjiCall("dji_osdk_ros/drone_task_control", {"task": 6})
    confirm_landing = None
    logger = "dji_sdk"
    reasons = _CONSOLE
    battery_scale, volt_scale = 0.01, 0.001


WRAPPERS: tuple[Wrapper, ...] = (PsdkRos2(), OsdkSdkNode(), OsdkVehicleNode())
