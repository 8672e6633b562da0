"""A MAVROS in front of a simulated autopilot: its topics, types, conversions and time-outs, as in
its sources (2.12, 1.21).

It is a node of the small rosbridge (`rosbridge.py`). While its services wait for acknowledgements, the autopilot's time
passes.
"""

from __future__ import annotations

import base64
import contextlib
import math
from array import array
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.autopilot import Autopilot
from tests.simulators.codec import AutopilotCodec
from tests.simulators.mavros_missions import NAMES, ListPlugin
from tests.simulators.mavros_parameters import ParamPlugin, on_server
from tests.simulators.ports import MemoryPort
from tests.simulators.rosbridge import Later, Message, Service
from ual.geometry import Quaternion, Vector3
from ual_daemon.backends.mavlink.dialects.axes import (
    enu_to_ned,
    enu_to_ned_yaw,
    enu_to_ned_yaw_rate,
    frd_to_flu,
    ned_to_enu,
    orientation_to_enu,
)
from ual_daemon.backends.mavlink.wire.frames import FrameReader

BEGIN_UTC_S = 1.8e9
EGM96_M = 47.9
"""Metres that it adds to altitudes above mean sea level: its model is not the receiver's."""
CONNECTION_TIMEOUT_S, ACK_TIMEOUT_S = 10.0, 5.0
_HEARTBEAT_S, _TIMESYNC_S = 1.0, 0.1
_ACK_STEPS = 4
"""An autopilot of these tests answers within so many steps, or not at all."""
_EVENT = 410
LISTS_S = 15.0
"""Seconds after it has found the autopilot until it reads the lists by itself."""

_PX4_MODES = {
    "MANUAL": (1, 0),
    "ACRO": (5, 0),
    "ALTCTL": (2, 0),
    "POSCTL": (3, 0),
    "OFFBOARD": (6, 0),
    "STABILIZED": (7, 0),
    "AUTO.MISSION": (4, 4),
    "AUTO.LOITER": (4, 3),
    "AUTO.RTL": (4, 5),
    "AUTO.LAND": (4, 6),
    "AUTO.READY": (4, 1),
    "AUTO.TAKEOFF": (4, 2),
}
_ARDUCOPTER_MODES = """
STABILIZE ACRO ALT_HOLD AUTO GUIDED LOITER RTL CIRCLE POSITION LAND OF_LOITER DRIFT - SPORT FLIP AUTOTUNE POSHOLD BRAKE
THROW AVOID_ADSB GUIDED_NOGPS
""".split()  # noqa: SIM905  as in its source


class Mavros:
    """The node `name` before an autopilot with the single link `port`. `ros` is 1 or 2.

    With `has_gps_status` it has the plugin gps_status of mavros_extras. Parameters are fetched `bootup_s` after it has
    found the autopilot. `target_system` may be wrong.
    """

    def __init__(
        self,
        autopilot: Autopilot,
        port: MemoryPort,
        *,
        ros: int = 1,
        name: str = "/mavros",
        has_gps_status: bool = False,
        bootup_s: float = 1.0,
        target_system: int | None = None,
    ) -> None:
        self._rtcm_count = 0
        self.autopilot = autopilot
        self.ros = ros
        self.name = name
        self.target_system = autopilot.system_id if target_system is None else target_system
        self.setpoints: list[tuple[float, Message]] = []
        """All setpoints that it has passed on, with the time."""
        self.clock_error_s = 0.0
        """By how much the clock of its computer is ahead."""
        self.is_gone = False
        """Whether the node has been killed: its topics and services are not there."""
        self.denied: set[str] = set()
        """The plugins on its deny list, of those that serve what is beside flying."""
        self.dies_in = ""
        """A service in which it dies, once it is called; it is started again at once."""
        self._port = port
        self._has_gps_status = has_gps_status
        self._bootup_s = bootup_s
        self._codec = AutopilotCodec(240)
        self._codec.join(1)
        self._out: deque[tuple[str, Message]] = deque()
        self._handlers: dict[str, Callable[[Any], None]] = {
            "HEARTBEAT": self._heartbeat,
            "EXTENDED_SYS_STATE": self._extended,
            "SYS_STATUS": self._sys_status,
            "BATTERY_STATUS": self._battery_status,
            "ESTIMATOR_STATUS": self._estimator,
            "STATUSTEXT": self._text,
            "ATTITUDE_QUATERNION": self._attitude,
            "LOCAL_POSITION_NED": self._local,
            "GLOBAL_POSITION_INT": self._global,
            "GPS_GLOBAL_ORIGIN": self._origin,
            "GPS_RAW_INT": self._gps,
            "VFR_HUD": self._hud,
            "HOME_POSITION": self._home,
            "RC_CHANNELS": self._rc,
            "SERVO_OUTPUT_RAW": self._servo_outputs,
            "TIMESYNC": self._timesync,
            "POSITION_TARGET_LOCAL_NED": self._target,
            "AUTOPILOT_VERSION": self._version,
            "COMMAND_ACK": self._ack,
            "PARAM_VALUE": self._parameter_value,
            "MOUNT_ORIENTATION": self._mount,
            "CAMERA_IMAGE_CAPTURED": self._captured,
            "GIMBAL_DEVICE_ATTITUDE_STATUS": self._gimbal,
        }
        self.server: dict[str, float] = {}
        """Values that it has put on the parameter server of ROS 1, which outlives it."""
        for name in ("COUNT", "ITEM_INT", "REQUEST_INT", "REQUEST", "ACK", "CURRENT", "ITEM_REACHED"):
            self._handlers[f"MISSION_{name}"] = self._mission_message
        self.latched: dict[str, Message] = {}
        """The newest of each topic of which a new subscriber gets the last message."""
        self.parameters = self._new_parameters()
        self.lists = self._new_lists()
        self.restart()

    def _new_lists(self) -> tuple[ListPlugin, ...]:
        target = (self.target_system, 1)
        return tuple(ListPlugin(name, self._send, self._publish_latched, target, ros=self.ros) for name in NAMES)

    @property
    def _plugins(self) -> tuple[ParamPlugin | ListPlugin, ...]:
        return (self.parameters, *self.lists)

    def _publish_latched(self, topic: str, message: Message) -> None:
        self.latched[f"{self.name}/{topic}"] = message
        self._publish(topic, message)

    def _new_parameters(self) -> ParamPlugin:
        target = (self.target_system, 1)
        return ParamPlugin(self._send, target, self.server, ros=self.ros, is_px4=self._is_px4)

    def restart(self) -> None:
        """Starts anew: it knows nothing."""
        self._reader = FrameReader()
        self._connected_s: float | None = None
        self._heard_s = -math.inf
        self._is_armed = False
        self._custom_mode = self._system_status = 0
        self._kind = self._software = self._uid = self._board = 0
        self._has_version = self._has_battery = False
        self._orientation, self._rates = Quaternion(0.0, 0.0, 0.0, 1.0), Vector3()
        self._fix = -1
        for each in self._plugins:
            each.die()
        self.parameters, self.lists = self._new_parameters(), self._new_lists()
        self.latched.clear()
        self._has_fetched = self._has_pulled = False
        self._acks: dict[int, int] = {}
        self._next_heartbeat_s = self._next_timesync_s = -math.inf
        self._version_asks = 0

    # --- The node -----------------------------------------------------------------------------------------------------

    @property
    def topics(self) -> Mapping[str, str]:
        kinds = {
            "state": "mavros_msgs/State",
            "extended_state": "mavros_msgs/ExtendedState",
            "sys_status": "mavros_msgs/SysStatus",
            "estimator_status": "mavros_msgs/EstimatorStatus",
            "statustext/recv": "mavros_msgs/StatusText",
            "local_position/pose": "geometry_msgs/PoseStamped",
            "local_position/velocity_local": "geometry_msgs/TwistStamped",
            "imu/data": "sensor_msgs/Imu",
            "global_position/global": "sensor_msgs/NavSatFix",
            "global_position/rel_alt": "std_msgs/Float64",
            "global_position/gp_origin": "geographic_msgs/GeoPointStamped",
            "global_position/raw/fix": "sensor_msgs/NavSatFix",
            "global_position/raw/satellites": "std_msgs/UInt32",
            "vfr_hud": "mavros_msgs/VfrHud",
            "home_position/home": "mavros_msgs/HomePosition",
            "battery": "sensor_msgs/BatteryState",
            "rc/in": "mavros_msgs/RCIn",
            "rc/out": "mavros_msgs/RCOut",
            "timesync_status": "mavros_msgs/TimesyncStatus",
            "setpoint_raw/target_local": "mavros_msgs/PositionTarget",
            "mount_control/orientation": "geometry_msgs/Quaternion",
            "camera/image_captured": "mavros_msgs/CameraImageCaptured",
        }
        for plugin in self.lists:
            kinds |= {} if plugin.name in self.denied else plugin.topics()
        if self._has_gps_status:
            kinds["gpsstatus/gps1/raw"] = "mavros_msgs/GPSRAW"
        if self.ros == 2:
            kinds["status_event"] = "mavros_msgs/StatusEvent"
            kinds["gimbal_control/device/attitude_status"] = "mavros_msgs/GimbalDeviceAttitudeStatus"
        return {} if self.is_gone else {f"{self.name}/{topic}": kind for topic, kind in kinds.items()}

    @property
    def subscriptions(self) -> Mapping[str, tuple[str, Callable[[Message], None]]]:
        kind = "mavros_msgs/PositionTarget"
        found = {
            f"{self.name}/setpoint_raw/local": (kind, self._setpoint),
            f"{self.name}/gps_rtk/send_rtcm": ("mavros_msgs/RTCM", self._rtcm),
        }
        return {} if self.is_gone else found

    @property
    def services(self) -> Mapping[str, Service]:
        found: dict[str, Service] = {
            "cmd/command": self._command_long,
            "cmd/command_int": self._command_int,
            "cmd/arming": self._arming,
            "cmd/takeoff": self._take_off,
            "set_mode": self._set_mode,
            "set_message_interval": self._set_interval,
            "vehicle_info_get": self._vehicle_info,
        }
        for plugin in self.lists:
            found |= plugin.services()
        found |= self.parameters.services()
        found = {name: call for name, call in found.items() if name.split("/")[0] not in self.denied}
        if self.dies_in in found:
            found[self.dies_in] = self._die
        ours = {} if self.is_gone else {f"{self.name}/{service}": call for service, call in found.items()}
        if self.ros == 1:
            ours["/rosapi/get_param"] = lambda message: on_server(self.name, self.server, message)
        return ours

    def _die(self, _: Message) -> Later:
        self.dies_in = ""
        self.restart()
        later = Later()
        later.is_lost = True
        return later

    @property
    def groups(self) -> tuple[frozenset[str], ...]:
        """Services of which ROS 2 executes one at a time (``srv_cg`` in sys_status.cpp and command.cpp)."""
        groups = (
            ("set_mode", "set_message_interval", "vehicle_info_get"),
            ("cmd/command", "cmd/command_int", "cmd/arming", "cmd/takeoff"),
            *(tuple(plugin.services()) for plugin in self._plugins),
        )
        return tuple(frozenset(f"{self.name}/{each}" for each in group) for group in groups) if self.ros == 2 else ()

    def step(self, now_s: float) -> Iterable[tuple[str, Message]]:
        while self.autopilot.elapsed_s < now_s - 1e-9:
            self.autopilot.step()
        self._receive()
        self._supervise(self.autopilot.elapsed_s)
        found, self._out = list(self._out), deque()
        return [] if self.is_gone else found

    def _receive(self) -> None:
        while self._port.sent:
            _, data = self._port.sent.popleft()
            for frame in self._reader.read(data):
                if frame.system_id != self.target_system:
                    continue
                if frame.message_id == _EVENT:
                    self._event(frame.payload)
                    continue
                with contextlib.suppress(mavlink.MAVError):  # also of a message that it does not know
                    message = self._codec.decode(frame)
                    self._handlers.get(message.get_type(), lambda _: None)(message)

    def _supervise(self, now_s: float) -> None:
        if self.is_gone:
            return
        if now_s >= self._next_heartbeat_s:
            self._next_heartbeat_s = now_s + _HEARTBEAT_S
            kind, invalid = mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID
            self._send(mavlink.MAVLink_heartbeat_message(kind, invalid, 192, 0, 4, 3))
        if now_s >= self._next_timesync_s:
            self._next_timesync_s = now_s + _TIMESYNC_S
            self._send(mavlink.MAVLink_timesync_message(0, round(self.utc_s * 1e9)))
        if self._connected_s is not None and now_s - self._heard_s > CONNECTION_TIMEOUT_S:
            self._connected_s, self._has_fetched = None, False
            self._publish("state", self._state(is_connected=False))
        if self._connected_s is not None and not self._has_fetched and now_s - self._connected_s >= self._bootup_s:
            self._has_fetched = True
            self.parameters.fetch()
        for each in self._plugins:
            each.tick(now_s)
        if self._connected_s is not None and not self._has_pulled and now_s - self._connected_s >= LISTS_S:
            self._has_pulled = True
            for plugin in self.lists:
                plugin.fetch()
        if self._connected_s is not None and not self._has_version and self._version_asks < 6:
            self._version_asks += 1
            self._command(mavlink.MAV_CMD_REQUEST_MESSAGE, 148.0)

    # --- What the autopilot sends -------------------------------------------------------------------------------------

    @property
    def utc_s(self) -> float:
        """The time of its computer."""
        return BEGIN_UTC_S + self.clock_error_s + self.autopilot.elapsed_s

    def _header(self, boot_ms: float | None = None) -> Message:
        """Returns a header: of the autopilot's time, where that is known, else of now."""
        stamp_s = self.utc_s
        if boot_ms is not None:
            stamp_s -= self.autopilot.now_s - boot_ms / 1000.0
        return {
            "stamp": {"sec": int(stamp_s), "nanosec": round(stamp_s % 1.0 * 1e9) % 1_000_000_000},
            "frame_id": "map",
        }

    def _publish(self, topic: str, message: Message) -> None:
        self._out.append((f"{self.name}/{topic}", message))

    def _send(self, message: Any) -> None:
        self._port.arriving.append(self._codec.encode(message))

    @property
    def _is_px4(self) -> bool:
        return bool(self.autopilot.autopilot == mavlink.MAV_AUTOPILOT_PX4)

    def _mode_name(self, custom_mode: int) -> str:
        if self._is_px4:
            main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24
            numbers = (main, sub if main == 4 else 0)
            names = (name for name, each in _PX4_MODES.items() if each == numbers)
            return next(names, f"CMODE({custom_mode})")
        known = custom_mode < len(_ARDUCOPTER_MODES) and _ARDUCOPTER_MODES[custom_mode] != "-"
        return _ARDUCOPTER_MODES[custom_mode] if known else f"CMODE({custom_mode})"

    def _heartbeat(self, message: Any) -> None:
        self._heard_s = self.autopilot.elapsed_s
        if self._connected_s is None:
            self._connected_s = self._heard_s
        self._kind, self._custom_mode = message.type, message.custom_mode
        self._is_armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        self._system_status = message.system_status
        self._publish("state", self._state(is_connected=True))

    def _state(self, *, is_connected: bool) -> Message:
        return {
            "header": self._header(),
            "connected": is_connected,
            "armed": is_connected and self._is_armed,
            "guided": False,
            "manual_input": False,
            "mode": self._mode_name(self._custom_mode) if is_connected else "",
            "system_status": self._system_status if is_connected else 0,
        }

    def _extended(self, message: Any) -> None:
        states = {"vtol_state": message.vtol_state, "landed_state": message.landed_state}
        self._publish("extended_state", {"header": self._header(), **states})

    def _sys_status(self, message: Any) -> None:
        sensors = {f"sensors_{name}": getattr(message, f"onboard_control_sensors_{name}") for name in _SENSORS}
        self._publish("sys_status", {"header": self._header(), **sensors})
        if not self._has_battery:
            volts, amperes = message.voltage_battery / 1000.0, message.current_battery / 100.0
            self._battery(volts, -amperes, message.battery_remaining / 100.0)

    def _battery_status(self, message: Any) -> None:
        self._has_battery = True
        volts = sum(each / 1000.0 for each in message.voltages if each != 0xFFFF)
        share = message.battery_remaining / 100.0
        self._battery(volts, -message.current_battery / 100.0, share, f"id{message.id}")

    def _battery(self, volts: float, amperes: float, share: float, location: str = "id0") -> None:
        unknown = dict.fromkeys(("charge", "capacity", "design_capacity"), math.nan)
        values = {"voltage": volts, "current": amperes, "percentage": share, "present": True, "location": location}
        self._publish("battery", {"header": self._header(), **values, **unknown})

    def _estimator(self, message: Any) -> None:
        flags = {f"{name}_status_flag": bool(message.flags >> bit & 1) for bit, name in enumerate(_FLAGS)}
        self._publish("estimator_status", {"header": self._header(), **flags})

    def _text(self, message: Any) -> None:
        self._publish("statustext/recv", {"header": self._header(), "severity": message.severity, "text": message.text})

    def _event(self, payload: bytes) -> None:
        payload = payload.ljust(53, b"\0")
        number, boot_ms = int.from_bytes(payload[:4], "little"), int.from_bytes(payload[4:8], "little")
        event = {"severity": payload[12] & 0xF, "px4_id": number & 0xFFFFFF, "arguments": array("B", payload[13:53])}
        if self.ros == 2:
            self._publish("status_event", {"header": self._header(boot_ms), **event, "sequence": 0})

    def _attitude(self, message: Any) -> None:
        self._orientation = orientation_to_enu(message.q1, message.q2, message.q3, message.q4)
        self._rates = frd_to_flu(message.rollspeed, message.pitchspeed, message.yawspeed)
        orientation = _quaternion(self._orientation)
        self._publish("imu/data", {"header": self._header(message.time_boot_ms), "orientation": orientation})

    def _local(self, message: Any) -> None:
        header = self._header(message.time_boot_ms)
        pose = {
            "position": _xyz(ned_to_enu(message.x, message.y, message.z)),
            "orientation": _quaternion(self._orientation),
        }
        self._publish("local_position/pose", {"header": header, "pose": pose})
        twist = {
            "linear": _xyz(ned_to_enu(message.vx, message.vy, message.vz)),
            "angular": _xyz(self._orientation.rotate(self._rates)),
        }
        self._publish("local_position/velocity_local", {"header": {**header, "frame_id": "base_link"}, "twist": twist})

    def _global(self, message: Any) -> None:
        header = self._header(message.time_boot_ms)
        place = {"latitude": message.lat / 1e7, "longitude": message.lon / 1e7, "altitude": message.alt / 1e3 + EGM96_M}
        self._publish(
            "global_position/global", {"header": header, "status": {"status": self._fix, "service": 1}, **place}
        )
        self._publish("global_position/rel_alt", {"data": message.relative_alt / 1e3})

    def _origin(self, message: Any) -> None:
        self._publish("global_position/gp_origin", {"header": self._header(), "position": _geo(message)})

    def _gps(self, message: Any) -> None:
        self._fix = 0 if message.fix_type > 2 else -1
        header = self._header()
        place = {"latitude": message.lat / 1e7, "longitude": message.lon / 1e7, "altitude": message.alt / 1e3 + EGM96_M}
        horizontal, vertical = (message.h_acc / 1e3) ** 2, (message.v_acc / 1e3) ** 2
        covariance = array("d", (horizontal, 0.0, 0.0, 0.0, horizontal, 0.0, 0.0, 0.0, vertical))
        if self._has_gps_status:
            names = ("fix_type", "lat", "lon", "alt", "satellites_visible", "alt_ellipsoid")
            self._publish("gpsstatus/gps1/raw", {"header": header, **{name: getattr(message, name) for name in names}})
        quality = {"position_covariance": covariance, "position_covariance_type": 3 if message.h_acc else 0}
        status = {"status": self._fix, "service": 1}
        self._publish("global_position/raw/fix", {"header": header, "status": status, **place, **quality})
        self._publish("global_position/raw/satellites", {"data": message.satellites_visible})

    def _hud(self, message: Any) -> None:
        self._publish("vfr_hud", {"header": self._header(), "altitude": message.alt})

    def _home(self, message: Any) -> None:
        self._publish("home_position/home", {"header": self._header(), "geo": _geo(message)})

    def _rc(self, message: Any) -> None:
        channels = array("H", (getattr(message, f"chan{number}_raw") for number in range(1, message.chancount + 1)))
        self._publish("rc/in", {"header": self._header(), "rssi": 255, "channels": channels})

    def _servo_outputs(self, message: Any) -> None:
        channels = array("H", (getattr(message, f"servo{number}_raw") for number in range(1, 17)))
        self._publish("rc/out", {"header": self._header(), "channels": channels})

    def _timesync(self, message: Any) -> None:
        if message.tc1:
            self._publish("timesync_status", {"header": self._header(), "remote_timestamp_ns": message.tc1})

    def _target(self, message: Any) -> None:
        place = {
            "position": _xyz(ned_to_enu(message.x, message.y, message.z)),
            "velocity": _xyz(ned_to_enu(message.vx, message.vy, message.vz)),
        }
        self._publish("setpoint_raw/target_local", {"header": self._header(), "type_mask": message.type_mask, **place})

    def _mount(self, message: Any) -> None:
        """As MAVROS does, which leaves the axes as they are."""
        degrees = (message.roll, message.pitch, message.yaw)
        self._publish("mount_control/orientation", _quaternion(Quaternion.from_euler(*map(math.radians, degrees))))

    def _captured(self, message: Any) -> None:
        geo = {"latitude": message.lat / 1e7, "longitude": message.lon / 1e7, "altitude": message.alt / 1e3 + EGM96_M}
        said = {"geo": geo, "relative_alt": message.relative_alt / 1e3, "image_index": message.image_index}
        said |= {"header": self._header(message.time_boot_ms), "capture_result": message.capture_result}
        self._publish("camera/image_captured", {**said, "file_url": message.file_url})

    def _gimbal(self, message: Any) -> None:
        if self.ros == 2:
            w, x, y, z = message.q
            said = {"flags": message.flags, "failure_flags": message.failure_flags}
            said |= {"header": self._header(message.time_boot_ms), "q": {"x": x, "y": y, "z": z, "w": w}}
            self._publish("gimbal_control/device/attitude_status", said)

    def _version(self, message: Any) -> None:
        self._has_version = True
        self._software, self._uid, self._board = message.flight_sw_version, message.uid, message.board_version

    def _ack(self, message: Any) -> None:
        self._acks[message.command] = message.result

    def _mission_message(self, message: Any) -> None:
        for plugin in self.lists:
            plugin.on_message(message)

    def _parameter_value(self, message: Any) -> None:
        self.parameters.on_value(message)

    # --- What it is asked for -----------------------------------------------------------------------------------------

    def _rtcm(self, message: Message) -> None:
        """As the plugin gps_rtk does, which sends no empty fragment after full ones."""
        data, sequence = base64.b64decode(message["data"]), self._rtcm_count % 32
        self._rtcm_count += 1
        fragments = [data[at : at + 180] for at in range(0, len(data), 180)]
        if len(fragments) > 4:
            return
        for number, each in enumerate(fragments):
            flags = sequence << 3 | (number << 1 | 1 if len(fragments) > 1 else 0)
            packed = mavlink.MAVLink_gps_rtcm_data_message(flags, len(each), each.ljust(180, b"\0"))
            self._send(packed)

    def _setpoint(self, message: Message) -> None:
        self.setpoints.append((self.autopilot.elapsed_s, message))
        position, velocity, acceleration = (
            enu_to_ned(_vector(message.get(name))) for name in ("position", "velocity", "acceleration_or_force")
        )
        self._send(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0,
                self.target_system,
                1,
                message["coordinate_frame"],
                message["type_mask"],
                *position,
                *velocity,
                *acceleration,
                enu_to_ned_yaw(message.get("yaw", 0.0)),
                enu_to_ned_yaw_rate(message.get("yaw_rate", 0.0)),
            )
        )

    def _command(self, command: int, *params: float) -> Message:
        """Sends a command, and waits for its acknowledgement."""
        self._acks.pop(command, None)
        values = (*params, *(0.0,) * (7 - len(params)))
        self._send(mavlink.MAVLink_command_long_message(self.target_system, 1, command, 0, *values))
        for _ in range(_ACK_STEPS):
            if command in self._acks:
                break
            self.autopilot.step()
            self._receive()
        result = self._acks.get(command)
        return {"success": result == 0, "result": result or 0}

    def _command_long(self, message: Message) -> Message:
        return self._command(message["command"], *(float(message.get(f"param{number}", 0.0)) for number in range(1, 8)))

    def _command_int(self, message: Message) -> Message:
        """Waits for nothing."""
        params = (float(message.get(f"param{number}", 0.0)) for number in range(1, 5))
        place = (message.get("x", 0), message.get("y", 0), float(message.get("z", 0.0)))
        frame, command = message["frame"], message["command"]
        self._send(mavlink.MAVLink_command_int_message(self.target_system, 1, frame, command, 0, 0, *params, *place))
        return {"success": True}

    def _arming(self, message: Message) -> Message:
        return self._command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, float(message["value"]))

    def _take_off(self, message: Message) -> Message:
        names = ("yaw", "latitude", "longitude", "altitude")
        return self._command(mavlink.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, *(float(message[name]) for name in names))

    def _set_mode(self, message: Message) -> Message:
        name = str(message["custom_mode"])
        if self._is_px4:
            main, sub = _PX4_MODES.get(name, (0, 0))
            number = main << 16 | sub << 24
        else:
            number = _ARDUCOPTER_MODES.index(name) if name in _ARDUCOPTER_MODES else -1
        if number <= 0 and name != "STABILIZE":
            return {"mode_sent": False}
        base_mode = 1 | (128 if self._is_armed else 0)
        self._send(mavlink.MAVLink_set_mode_message(self.target_system, base_mode, number))
        return {"mode_sent": True}

    def _set_interval(self, message: Message) -> Message:
        answer = self._command(
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, float(message["message_id"]), 1e6 / message["message_rate"]
        )
        return {"success": answer["success"]}

    def _vehicle_info(self, message: Message) -> Message:
        if self._connected_s is None:
            return {"success": False, "vehicles": []}
        vehicle = {
            "available_info": 3 if self._has_version else 1,
            "sysid": self.target_system,
            "autopilot": self.autopilot.autopilot,
            "type": self._kind,
            "flight_sw_version": self._software,
            "board_version": self._board,
            "vendor_id": 0,
            "product_id": 0,
            "uid": self._uid,
        }
        return {"success": True, "vehicles": [vehicle]}


_FLAGS = """
attitude velocity_horiz velocity_vert pos_horiz_rel pos_horiz_abs pos_vert_abs pos_vert_agl const_pos_mode
""".split()  # noqa: SIM905
_SENSORS = ("present", "enabled", "health")


def _geo(message: Any) -> Message:
    place = {"latitude": message.latitude / 1e7, "longitude": message.longitude / 1e7}
    return {**place, "altitude": message.altitude / 1e3 + EGM96_M}


def _xyz(vector: Vector3) -> Message:
    return {"x": vector.x, "y": vector.y, "z": vector.z}


def _quaternion(q: Quaternion) -> Message:
    return {"x": q.x, "y": q.y, "z": q.z, "w": q.w}


def _vector(message: Message | None) -> Vector3:
    return Vector3() if message is None else Vector3(message["x"], message["y"], message["z"])
