"""The base of all simulated autopilots: time, flight, streams, commands, parameters; and the safety pilot."""

from __future__ import annotations

import heapq
import itertools
import math
import random
import struct
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.channel import Channel
from tests.simulators.fence import CIRCLES, POLYGONS, Fence, Item
from tests.simulators.files import FileStore
from tests.simulators.mission_flight import MissionFlight
from tests.simulators.mission_store import MISSION, MissionStore, Sender
from tests.simulators.mount import Mount
from tests.simulators.parachute import COMMAND as PARACHUTE
from tests.simulators.parachute import Parachute
from tests.simulators.physics import ZERO, Agility, Body, Target, Vector, Wander, control, minus, plus, wrap
from tests.simulators.satellite_receiver import SatelliteReceiver
from tests.simulators.trigger import Trigger
from ual.geometry import Vector3
from ual_daemon.backends.firmwares.mission_items import MissionItem
from ual_daemon.backends.mavlink.wire.frames import MavlinkFrame
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.geodesy import Projection

STEP_S = 0.02
ACCEPTED: int = mavlink.MAV_RESULT_ACCEPTED
REJECTED: int = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
UNSUPPORTED: int = mavlink.MAV_RESULT_UNSUPPORTED
FAILED: int = mavlink.MAV_RESULT_FAILED
SET_MODE = -1
"""Stands for the message SET_MODE in `Autopilot.commands`."""
FORCE = 21196.0
"""The second parameter of an arming command that forces arming or disarming."""
GEOID_SEPARATION_M = 47.4
STICKS_LOST_S = 0.5
_EXTERNAL_FRESH_S = 0.5
_PARAMETER_S = 0.005
"""The time between two parameters of a list."""


@dataclass(frozen=True, slots=True)
class Sticks:
    """The sticks of the transmitter, each from -1 to 1."""

    forward: float = 0.0
    right: float = 0.0
    up: float = 0.0
    turn_right: float = 0.0


class Autopilot(ABC):
    """One vehicle. Its time stands still until `step` is called; the same steps and inputs always have the same effect.

    `step` and what the pilot does may come from different threads. Positions are in metres north, east and down from
    the estimator's origin; `start` is the position on the ground. `wander_m` is how far the estimate drifts.
    """

    kind = mavlink.MAV_TYPE_QUADROTOR
    component_id: int = mavlink.MAV_COMP_ID_AUTOPILOT1
    autopilot: int
    flight_sw_version: int
    external_pose_message: int
    """The message by which it takes poses from outside."""
    parameter_type = mavlink.MAV_PARAM_TYPE_REAL32
    files_slow_streams = 1.0
    """By how much its streams come less often while it sends files."""
    make_store: Callable[[Callable[[], None]], MissionStore]
    """Makes what keeps its mission, its fence and its rally points. It takes what is called after a change."""

    def __init__(
        self,
        channels: Iterable[Channel],
        projection: Projection,
        *,
        system_id: int,
        start: Vector,
        boot_s: float,
        seed: int,
        wander_m: float,
    ) -> None:
        self.lock = threading.RLock()
        self.system_id = system_id
        self.channels = list(channels)
        self.projection = projection
        self.noise = random.Random(seed)
        self._booted_at: Vector = (0.0, 0.0, start[2])
        """Position in its local frame after a reboot."""
        self.body = Body(position=start, ground_z_m=start[2])
        self.origin: Vector = ZERO
        """Position of the estimator's origin on the ground, from its first one."""
        self.estimate_error: Vector = ZERO
        """Error of the estimate, as `jump` left it."""
        self.heading_error_rad = 0.0
        """Error of its estimate of the heading, which `body` has, as `jump_heading` left it."""
        self.velocity_error: Vector = ZERO
        """Error of its estimate of the velocity, beside a position that is right: PX4 has it for seconds."""
        self.resets_count = 0
        """Resets of the estimator, as PX4 counts them."""
        self.has_satellites = True
        """Whether it knows where it is on Earth; without (indoors), another sensor keeps its position good."""
        self.wander = Wander(wander_m, self.noise)
        self.is_gps_good = True
        self.external_pose_s = -math.inf
        """Time of the last external pose that it uses."""
        self.external_poses: list[Message] = []
        """All poses from outside for it, used or not."""
        self.arm_refusal = ""
        """Why it cannot be armed; empty if it can."""
        self.failing_sensors = 0
        """Sensors of SYS_STATUS (MAV_SYS_STATUS) that are not healthy."""
        self.batteries = [(0, 0, 90)]
        """The id, the MAV_BATTERY_FUNCTION and the charge (in percent) of each."""
        self.said = ""
        """Its last STATUSTEXT."""
        self.sticks = Sticks()
        self.ignored: set[int] = set()
        """Ids of messages and of commands that it ignores, for tests without an answer."""
        self.is_old = False
        """Whether it knows no commands for single messages."""
        self.missions = type(self).make_store(self._on_fence_set)
        self.fence = Fence(self.missions)
        self.files = FileStore(is_px4=self.autopilot == mavlink.MAV_AUTOPILOT_PX4, is_armed=lambda: self.is_armed)
        self.parameters = dict(self.default_parameters())
        self.kept_parameters: set[str] = set()
        """Names of parameters that it keeps as they are, whatever is written."""
        self.withheld_parameters: set[str] = set()
        """Names of parameters that it never sends."""
        self.builders: dict[int, Callable[[], Message | None]] = self._builders()
        self.mount: Mount | None = None
        self.parachute: Parachute | None = None
        """Its gimbal."""
        self.trigger: Trigger | None = None
        """Its camera."""
        self.receiver = SatelliteReceiver()
        """Data that its satellite receiver is given."""
        self._handlers: dict[int, Callable[[Message, Sender], None]] = {
            mavlink.MAVLINK_MSG_ID_COMMAND_LONG: self._on_command_long,
            mavlink.MAVLINK_MSG_ID_COMMAND_INT: self._on_command_int,
            mavlink.MAVLINK_MSG_ID_SET_MODE: self._on_set_mode,
            mavlink.MAVLINK_MSG_ID_TIMESYNC: self._on_timesync,
            mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ: self._on_param_request_read,
            mavlink.MAVLINK_MSG_ID_GPS_RTCM_DATA: lambda message, _: self.receiver.on_rtcm_data(message),
            mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: self._on_param_request_list,
            mavlink.MAVLINK_MSG_ID_PARAM_SET: self._on_param_set,
            mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED: self._on_local_target,
            mavlink.MAVLINK_MSG_ID_MANUAL_CONTROL: self._on_manual_control,
            mavlink.MAVLINK_MSG_ID_MISSION_SET_CURRENT: self._on_mission_set_current,
            **{message_id: partial(self._transfer, act) for message_id, act in self.missions.handlers().items()},
            **{message_id: partial(self._transfer, act) for message_id, act in self.files.handlers().items()},
            self.external_pose_message: self._on_external_pose,
        }
        self._later: list[tuple[float, int, Callable[[], None]]] = []
        self._count = itertools.count()
        self.is_armed = False
        self.has_thrust = True
        """Whether its motors work: dead ones are not told."""
        self.is_killed = False
        """Whether a switch of the pilot, or a termination, stops its motors; see `kill`."""
        self.home: Vector | None = None
        self.now_s = 0.0
        """Time since it has booted."""
        self.elapsed_s = boot_s
        """Time since its start; a reboot does not reset it."""
        self.commands: list[tuple[float, int, tuple[float, ...], tuple[int, int]]] = []
        """All commands for it: time, id, parameters, system and component of the sender."""
        self.setpoints_s: list[float] = []
        """The times of all setpoints for it, usable or not."""
        self.setpoint_senders: list[tuple[int, int]] = []
        """The system and component of the sender of each of them."""
        self._boot(boot_s)

    # Time

    def step(self) -> None:
        """Advances its time by `STEP_S`."""
        with self.lock:
            self.now_s += STEP_S
            self.elapsed_s += STEP_S
            for channel in self.channels:
                for frame, message in channel.receive(self.elapsed_s):
                    if not self.is_booting:
                        self._take(channel, frame, message)
            while self._later and self._later[0][0] <= self.elapsed_s:
                heapq.heappop(self._later)[2]()
            if not self.is_booting:
                self.missions.tick(self.elapsed_s)
            self.wander.step(STEP_S)
            self._fly()
            if self.trigger is not None:
                self.trigger.step()
            self.files.step(self.elapsed_s)
            for channel in self.channels:
                channel.slowdown = self.files_slow_streams if self.elapsed_s - self.files.sent_s < 1.0 else 1.0
            if not self.is_booting:
                for channel in self.channels:
                    for message_id in channel.due(self.elapsed_s, STEP_S):
                        self._stream(channel, message_id)

    def run(self, duration_s: float) -> None:
        """Advances its time."""
        for _ in range(round(duration_s / STEP_S)):
            self.step()

    def reboot(self, carried: Vector = ZERO, gps_error: Vector = ZERO) -> None:
        """Reboots: its time starts again at 0, TCP connections close, and it is silent for a while.

        Its origin is then where it stands. `carried` is how far it was carried meanwhile, and `gps_error` how far off
        the place is that it then takes for its own on Earth.
        """
        with self.lock:
            for channel in self.channels:
                channel.port.restart()
            self.is_armed = False
            self.estimate_error, self.resets_count = ZERO, 0
            self._move_origin(minus(plus(self.body.position, carried), self._booted_at), gps_error)
            self.body.position = self._booted_at
            self.body.ground_z_m = self._booted_at[2]
            self.body.stand()
            self._boot(0.0)

    def move_origin(self, offset: Vector) -> None:
        """Moves the origin of the local frame, as PX4 does at SET_GPS_GLOBAL_ORIGIN: the vehicle does not move."""
        with self.lock:
            self._move_origin(offset)
            self.body.position = minus(self.body.position, offset)
            self.body.ground_z_m -= offset[2]
            self.home = None if self.home is None else minus(self.home, offset)
            self.resets_count += 2
            self._shift_targets(minus(ZERO, offset))

    def _move_origin(self, offset: Vector, gps_error: Vector = ZERO) -> None:
        north, east, down = plus(offset, gps_error)
        point = self.projection.to_geo(Vector3(east, north, -down))
        assert point.altitude_amsl_m is not None
        self.projection = replace(
            self.projection,
            latitude_deg=point.latitude_deg,
            longitude_deg=point.longitude_deg,
            altitude_amsl_m=point.altitude_amsl_m,
        )
        self.origin = plus(self.origin, offset)

    def jump(self, offset: Vector) -> None:
        """Resets the estimate: it jumps, and its own targets with it. The vehicle and the origin do not move."""
        with self.lock:
            self.estimate_error = plus(self.estimate_error, offset)
            self.resets_count += 1
            self._shift_targets(offset)

    def jump_heading(self, by_rad: float) -> None:
        """Resets the estimate of the heading, and its own targets with it. The vehicle does not turn."""
        with self.lock:
            self.heading_error_rad += by_rad
            self.body.yaw_rad = wrap(self.body.yaw_rad + by_rad)
            self.resets_count += 1
            self._turn_targets(by_rad)

    @property
    def true_heading_rad(self) -> float:
        """True heading of its nose."""
        return wrap(self.body.yaw_rad - self.heading_error_rad)

    @abstractmethod
    def _turn_targets(self, by_rad: float) -> None:
        """Turns the heading that it holds by itself with its estimate, so that its nose stays where it is."""

    @abstractmethod
    def _shift_targets(self, offset: Vector) -> None:
        """Moves what it holds by itself with its estimate, so that it stays where it is."""

    def close(self) -> None:
        """Ends its links."""
        for channel in self.channels:
            channel.port.close()

    @property
    def is_booting(self) -> bool:
        """Whether it is still booting, and silent."""
        return self.now_s < self._awake_s

    @property
    def time_ms(self) -> int:
        return int(self.now_s * 1000.0) & 0xFFFFFFFF

    def at(self, delay_s: float, action: Callable[[], None]) -> None:
        """Does something later, by its own time."""
        heapq.heappush(self._later, (self.elapsed_s + delay_s, next(self._count), action))

    def _boot(self, boot_s: float) -> None:
        self.now_s = boot_s
        self._awake_s = 0.0 if boot_s else 2.0
        if not boot_s:
            self.missions.boot(self.elapsed_s)
            self.system_id = int(self.parameters.get("MAV_SYS_ID", self.system_id))
        self._later.clear()
        self.armed_s = -math.inf
        self.sticks_s = -math.inf
        self.gps_lost_s = math.inf
        self.external_pose_s = -math.inf
        self.home = self.position if self.is_gps_good and self.has_satellites else None
        for channel in self.channels:
            channel.boot(self.system_id, self.elapsed_s + self._awake_s, self.component_id)

    # What it knows of itself

    @property
    def position(self) -> Vector:
        """The estimated position."""
        x, y, z = self.body.position
        dx, dy, dz = self.wander.position
        ex, ey, ez = self.estimate_error
        return (x + dx + ex, y + dy + ey, z + dz + ez)

    @property
    def current_position(self) -> Vector:
        """True position, from its first origin."""
        return plus(self.body.position, self.origin)

    @property
    def velocity(self) -> Vector:
        """The estimated velocity."""
        x, y, z = self.body.velocity
        dx, dy, dz = self.wander.velocity
        ex, ey, ez = self.velocity_error
        return (x + dx + ex, y + dy + ey, z + dz + ez)

    @property
    def is_aided(self) -> bool:
        """Whether GPS, or poses from outside, say where it is."""
        return self.is_gps_good or self.now_s - self.external_pose_s <= _EXTERNAL_FRESH_S

    @property
    def unaided_s(self) -> float:
        """Seconds without GPS and external poses; negative while it has GPS."""
        return self.now_s - max(self.gps_lost_s, self.external_pose_s)

    @property
    def has_sticks(self) -> bool:
        """Whether it receives a transmitter."""
        return self.now_s - self.sticks_s <= STICKS_LOST_S

    @property
    @abstractmethod
    def is_ready_to_arm(self) -> bool: ...

    # The safety pilot

    @abstractmethod
    def pilot_readies(self) -> None:
        """The safety pilot leaves a mode in which it cannot be armed."""

    def pilot_arm(self) -> bool:
        """The safety pilot arms. Returns whether it is armed."""
        with self.lock:
            return self.arm(is_forced=False) == ACCEPTED

    def pilot_disarm(self, *, is_forced: bool = False) -> bool:
        with self.lock:
            return self.disarm(is_forced=is_forced) == ACCEPTED

    @abstractmethod
    def pilot_take_over(self) -> None:
        """The safety pilot sets the mode switch, with the sticks centred."""

    def pilot_moves(self, sticks: Sticks) -> None:
        """The safety pilot holds the sticks in this position from now on."""
        with self.lock:
            self.sticks = sticks
            self.sticks_s = math.inf

    def lose_gps(self) -> None:
        """Takes away GPS reception from now on."""
        with self.lock:
            self.is_gps_good = False
            self.gps_lost_s = self.now_s

    def find_gps(self) -> None:
        """Restores GPS reception."""
        with self.lock:
            self.is_gps_good = True
            self.gps_lost_s = math.inf

    def kill(self, is_killed: bool = True) -> None:
        """The pilot sets the switch that stops the motors at once, or sets it back: the vehicle stays armed."""
        with self.lock:
            self.is_killed = is_killed

    # Flying

    @property
    def _falls(self) -> bool:
        return not self.has_thrust or self.is_killed

    @abstractmethod
    def _fly(self) -> None:
        """Moves the vehicle by one step."""

    def _follow(self, target: Target, agility: Agility) -> None:
        acceleration, yaw_rate = control(agility, target, self.position, self.velocity, self.body.yaw_rad)
        self.body.fly(acceleration, yaw_rate, agility.jerk_m_s3, STEP_S)

    def _stick_velocity(self, speed_m_s: float, climb_m_s: float) -> Vector:
        """Returns the velocity that the sticks command, rotated by the heading."""
        sticks, yaw_rad = self.sticks, self.body.yaw_rad
        forward, right = sticks.forward * speed_m_s, sticks.right * speed_m_s
        cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
        return (forward * cos - right * sin, forward * sin + right * cos, -sticks.up * climb_m_s)

    # Commands

    @abstractmethod
    def arm(self, *, is_forced: bool) -> int:
        """Arms. Returns the result (MAV_RESULT)."""

    @abstractmethod
    def disarm(self, *, is_forced: bool) -> int:
        """Disarms. Returns the result (MAV_RESULT)."""

    @abstractmethod
    def _command(self, command: int, params: tuple[float, ...], sender: Sender) -> int | None:
        """Handles a command of this kind of autopilot. Returns the result; None if it has answered already."""

    @abstractmethod
    def _on_local_target(self, message: Message, sender: Sender) -> None: ...

    def _on_external_pose(self, message: Message, sender: Sender) -> None:
        """Without GPS its estimate is where the pose says."""
        self.external_poses.append(message)
        if not self.uses(message):
            return
        self.external_pose_s = self.now_s
        if not self.is_gps_good:
            dx, dy, dz = self.wander.position
            self.estimate_error = minus((message.x, message.y, message.z), plus(self.body.position, (dx, dy, dz)))

    def uses(self, message: Message) -> bool:
        """Returns whether it is set up to use a pose from outside, and this is one as it takes them."""
        return False

    @abstractmethod
    def _may_stream(self, message_id: int) -> int:
        """Returns the result of SET_MESSAGE_INTERVAL for a message."""

    def _on_manual_control(self, message: Message, sender: Sender) -> None:
        if message.target == self.system_id:
            self.sticks = Sticks(message.x / 1000.0, message.y / 1000.0, message.z / 500.0 - 1.0, message.r / 1000.0)
            self.sticks_s = self.now_s

    def _take(self, channel: Channel, frame: MavlinkFrame, message: Message) -> None:
        handler = self._handlers.get(frame.message_id)
        target = getattr(message, "target_system", 0), getattr(message, "target_component", 0)
        if channel.forwards and (frame.message_id in (0, 69) or target[0] not in (0, self.system_id)):
            for other in self.channels:
                if other is not channel:
                    other.port.send(frame.data, self.elapsed_s)
        if self._take_parachute(message, Sender(channel, frame.system_id, frame.component_id)):
            return
        is_ours = target[0] in (0, self.system_id) and target[1] in (0, self.component_id)
        if handler is not None and is_ours and frame.message_id not in self.ignored:
            handler(message, Sender(channel, frame.system_id, frame.component_id))

    def _take_parachute(self, message: Message, sender: Sender) -> bool:
        """Returns whether a command is for the parachute, which then has taken it."""
        if self.parachute is None or getattr(message, "command", None) != PARACHUTE:
            return False
        if message.target_component == self.parachute.component_id:
            self.parachute.on_command(message, sender)
            return True
        return False

    def _on_command_long(self, message: Message, sender: Sender) -> None:
        params = tuple(float(getattr(message, f"param{number}")) for number in range(1, 8))
        self._obey(message.command, params, sender)

    def _on_set_mode(self, message: Message, sender: Sender) -> None:
        """Changes the mode by the message that came before the command, which is never acknowledged."""
        self.commands.append((self.elapsed_s, SET_MODE, (float(message.custom_mode),), _ids(sender)))
        if SET_MODE not in self.ignored:
            self.request_custom_mode(message.custom_mode)

    @abstractmethod
    def request_custom_mode(self, custom_mode: int) -> None:
        """Changes to the mode of a number as in heartbeats, if it can."""

    def _on_command_int(self, message: Message, sender: Sender) -> None:
        params = (message.param1, message.param2, message.param3, message.param4, message.x, message.y, message.z)
        self._obey(message.command, tuple(map(float, params)), sender)

    def _obey(self, command: int, params: tuple[float, ...], sender: Sender) -> None:
        self.commands.append((self.elapsed_s, command, params, (sender.system_id, sender.component_id)))
        if command in self.ignored:
            return
        if self.is_old and command in (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE):
            result: int | None = UNSUPPORTED
        elif command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            result = self._set_interval(int(params[0]), params[1], sender.channel)
        elif command == mavlink.MAV_CMD_REQUEST_MESSAGE:
            result = self._request(int(params[0]), sender.channel)
        elif command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            act = self.arm if params[0] else self.disarm
            result = act(is_forced=params[1] == FORCE)
        elif command == mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN and params[0] == 1.0:
            result = REJECTED if self.is_armed else ACCEPTED
            if result == ACCEPTED:
                self.at(0.1, self.reboot)
        elif self.mount is not None and command in self.mount.commands:
            result = self.mount.obey(command, params)
        elif self.trigger is not None and command in self.trigger.commands:
            result = self.trigger.obey(command, params)
        else:
            result = self._command(command, params, sender)
        if result is not None:
            self._acknowledge(command, result, sender)

    def _acknowledge(self, command: int, result: int, sender: Sender) -> None:
        ack = mavlink.MAVLink_command_ack_message(command, result, 0, 0, sender.system_id, sender.component_id)
        sender.channel.send(ack, self.elapsed_s)

    def _set_interval(self, message_id: int, interval_us: float, channel: Channel) -> int:
        result = self._may_stream(message_id)
        if result == ACCEPTED:
            channel.stream(message_id, None if interval_us < 0.0 else interval_us / 1e6, self.elapsed_s)
        return result

    def _request(self, message_id: int, channel: Channel) -> int:
        build = self.builders.get(message_id)
        message = None if build is None else build()
        if message is None:
            return UNSUPPORTED if build is None else REJECTED
        channel.send(message, self.elapsed_s)
        return ACCEPTED

    def _on_timesync(self, message: Message, sender: Sender) -> None:
        if message.tc1 == 0:
            sender.channel.send(mavlink.MAVLink_timesync_message(round(self.now_s * 1e9), message.ts1), self.elapsed_s)

    # Parameters

    @abstractmethod
    def default_parameters(self) -> dict[str, float]:
        """Parameters by name. An int is an integer in the autopilot, too."""

    def _on_param_request_read(self, message: Message, sender: Sender) -> None:
        names = list(self.parameters)
        name = message.param_id if message.param_index < 0 else names[message.param_index % len(names)]
        self._send_parameter(name, sender)

    def _on_param_request_list(self, message: Message, sender: Sender) -> None:
        for count, name in enumerate(list(self.parameters)):
            self.at(count * _PARAMETER_S, partial(self._send_parameter, name, sender))

    def _send_parameter(self, name: str, sender: Sender) -> None:
        if name in self.parameters and name not in self.withheld_parameters:
            sender.channel.send(self._parameter(name), self.elapsed_s)

    def _on_param_set(self, message: Message, sender: Sender) -> None:
        if message.param_id in self.parameters:
            is_whole = isinstance(self.parameters[message.param_id], int)
            value = message.param_value
            if is_whole:
                value = self._from_wire(value)
            if message.param_id not in self.kept_parameters:
                self.parameters[message.param_id] = value
            self._on_gps_parameter(message.param_id, value)
            self._on_id_parameter(message.param_id)
            for channel in self.channels:
                channel.send(self._parameter(message.param_id), self.elapsed_s)

    def _on_gps_parameter(self, name: str, value: float) -> None:
        """Takes GPS away and gives it back, as the simulators do by parameters."""
        is_lost = {"SIM_GPS_DISABLE": value > 0, "SIM_GPS_USED": value < 4}.get(name)
        if is_lost is not None:
            (self.lose_gps if is_lost else self.find_gps)()

    def _on_id_parameter(self, name: str) -> None:
        """Sends as another system at once, as ArduPilot does; PX4 does after a boot."""
        if name == "SYSID_THISMAV":
            self._become(int(self.parameters[name]))

    def _become(self, system_id: int) -> None:
        self.system_id = system_id
        for channel in self.channels:
            channel.become(system_id)

    def _parameter(self, name: str) -> Message:
        value = self.parameters[name]
        is_whole = isinstance(value, int)
        kind = mavlink.MAV_PARAM_TYPE_INT32 if is_whole else mavlink.MAV_PARAM_TYPE_REAL32
        on_wire = self._to_wire(value) if isinstance(value, int) else value
        index = list(self.parameters).index(name)
        return mavlink.MAVLink_param_value_message(name.encode(), on_wire, kind, len(self.parameters), index)

    def _to_wire(self, value: int) -> float:
        """PX4 sends the bytes of an integer in the place of the number, ArduPilot the number."""
        on_wire: float = struct.unpack("<f", struct.pack("<i", value))[0]
        return on_wire

    def _from_wire(self, value: float) -> int:
        number: int = struct.unpack("<i", struct.pack("<f", value))[0]
        return number

    # Its own fence

    def set_fence(self, *zones: tuple[bool, list[tuple[float, float]], float | None]) -> None:
        """Keeps another fence, as after a ground station has uploaded it.

        Each zone is whether it is an inclusion, its corners or its centre in metres north and east, and its radius.
        """
        with self.lock:
            items = []
            for is_inclusion, points, radius_m in zones:
                command = (POLYGONS if radius_m is None else CIRCLES)[is_inclusion]
                size = float(len(points)) if radius_m is None else radius_m
                places = (self.geo((north, east, 0.0)) for north, east in points)
                items += [Item(command, size, latitude, longitude) for latitude, longitude, _ in places]
            self.fence.items = items

    def _on_fence_set(self) -> None:  # noqa: B027  nothing, on PX4, which tells its checksum each second
        """Tells what it tells by itself when it has got a new fence."""

    def is_beyond_zones(self, position: Vector) -> bool:
        """Returns whether a position is outside an inclusion of its own fence, or in an exclusion."""
        if self.fence.is_empty:
            return False
        latitude, longitude, _ = self.geo(position)
        return self.fence.is_beyond(latitude, longitude, self.projection)

    # Its mission

    mission: MissionFlight
    """Flight of its mission; made at each boot."""

    def _new_mission(self, first: int) -> MissionFlight:
        found = MissionFlight(lambda: self.missions.lists[MISSION], first, self._mission_position, self._on_reached)
        self.missions.on_mission = self._on_mission_changed
        found.reset()
        return found

    def _on_mission_changed(self) -> None:
        self.mission.replaced()

    def station_uploads(self, items: Sequence[MissionItem]) -> None:
        """Another station brings a mission."""
        with self.lock:
            self.missions.keep(MISSION, items)

    def _mission_position(self, item: MissionItem) -> Vector:
        """Returns the place of an item, in metres north, east and down."""
        altitude_m = item.z
        if item.frame in (3, 6):
            home_z_m = 0.0 if self.home is None else self.home[2]
            altitude_m = self.projection.altitude_amsl_m - home_z_m + item.z
        place = self.projection.to_local(item.x / 1e7, item.y / 1e7, altitude_m)
        return place.y, place.x, -place.z

    def _on_reached(self, seq: int) -> None:
        for channel in self.channels:
            channel.send(mavlink.MAVLink_mission_item_reached_message(seq), self.elapsed_s)

    def _on_mission_set_current(self, message: Message, sender: Sender) -> None:
        if self.mission.choose(message.seq):
            self._request(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, sender.channel)

    def _transfer(self, act: Callable[[Message, Sender, float], None], message: Message, sender: Sender) -> None:
        act(message, sender, self.elapsed_s)

    # Messages

    def say(self, text: str, severity: int = mavlink.MAV_SEVERITY_CRITICAL) -> None:
        """Sends a STATUSTEXT on the links that get them."""
        self.said = text
        for channel in self.channels:
            if self._hears_texts(channel):
                channel.send(mavlink.MAVLink_statustext_message(severity, text.encode()[:50]), self.elapsed_s)

    def _hears_texts(self, channel: Channel) -> bool:
        return True

    def _stream(self, channel: Channel, message_id: int) -> None:
        message = self.builders[message_id]()
        if message is not None:
            channel.send(message, self.elapsed_s)

    def _builders(self) -> dict[int, Callable[[], Message | None]]:
        """Returns the function that makes each message. Subclasses add theirs."""
        return {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: self.heartbeat,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: self._attitude,
            mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: self._attitude_quaternion,
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._local_position,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._global_position,
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: self._gps_raw,
            mavlink.MAVLINK_MSG_ID_VFR_HUD: self._vfr_hud,
            mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: self._origin,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: self._home_position,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: self._sys_status,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self._extended_sys_state,
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: self._battery_status,
            mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self._autopilot_version,
            mavlink.MAVLINK_MSG_ID_TIMESYNC: lambda: mavlink.MAVLink_timesync_message(0, round(self.now_s * 1e9)),
        }

    @abstractmethod
    def heartbeat(self) -> Message: ...

    @property
    @abstractmethod
    def landed_state(self) -> int:
        """Returns the MAV_LANDED_STATE."""

    def _attitude(self) -> Message:
        roll, pitch = self.body.tilt
        return mavlink.MAVLink_attitude_message(
            self.time_ms, roll, pitch, self.body.yaw_rad, 0.0, 0.0, self.body.yaw_rate_rad_s
        )

    def _quaternion(self) -> tuple[float, float, float, float]:
        roll, pitch = self.body.tilt
        cr, sr = math.cos(roll / 2), math.sin(roll / 2)
        cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
        cy, sy = math.cos(self.body.yaw_rad / 2), math.sin(self.body.yaw_rad / 2)
        return (
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        )

    def _attitude_quaternion(self) -> Message:
        return mavlink.MAVLink_attitude_quaternion_message(
            self.time_ms, *self._quaternion(), 0.0, 0.0, self.body.yaw_rate_rad_s
        )

    def _local_position(self) -> Message | None:
        return mavlink.MAVLink_local_position_ned_message(self.time_ms, *self.position, *self.velocity)

    def geo(self, position: Vector) -> tuple[int, int, int]:
        """Converts a local position to latitude, longitude (1e-7 degrees) and altitude above mean sea level (mm)."""
        north, east, down = position
        point = self.projection.to_geo(Vector3(east, north, -down))
        assert point.altitude_amsl_m is not None
        return round(point.latitude_deg * 1e7), round(point.longitude_deg * 1e7), round(point.altitude_amsl_m * 1e3)

    def _global_position(self) -> Message | None:
        if not self.has_satellites:
            return None
        latitude, longitude, altitude = self.geo(self.position)
        above_home = 0.0 if self.home is None else self.home[2] - self.position[2]
        vx, vy, vz = (round(v * 100.0) for v in self.velocity)
        heading = round(math.degrees(self.body.yaw_rad) * 100.0) % 36000
        return mavlink.MAVLink_global_position_int_message(
            self.time_ms, latitude, longitude, altitude, round(above_home * 1e3), vx, vy, vz, heading
        )

    def _vfr_hud(self) -> Message:
        speed, climb = math.hypot(*self.velocity[:2]), -self.velocity[2]
        return mavlink.MAVLink_vfr_hud_message(0.0, speed, 0, 0, self.geo(self.position)[2] / 1e3, climb)

    def _sim_state(self) -> Message:
        """Returns where it really is, as ArduPilot's simulator tells."""
        latitude, longitude, altitude = self.geo(self.body.position)
        zeros, speeds = (0.0,) * 13, self.body.velocity
        degrees = (latitude / 1e7, longitude / 1e7, altitude / 1e3, 0.0, 0.0)
        return mavlink.MAVLink_sim_state_message(*zeros, *degrees, *speeds, latitude, longitude)

    def _hil_state(self) -> Message:
        """Returns where it really is, as PX4's simulator tells."""
        latitude, longitude, altitude = self.geo(self.body.position)
        return mavlink.MAVLink_hil_state_quaternion_message(
            0, (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0, latitude, longitude, altitude, *(0,) * 8
        )

    def _gps_raw(self) -> Message:
        latitude, longitude, altitude = self.geo(self.body.position)
        if not (self.is_gps_good and self.has_satellites):
            return mavlink.MAVLink_gps_raw_int_message(
                round(self.now_s * 1e6), 0, latitude, longitude, altitude, 0xFFFF, 0xFFFF, 0xFFFF, 0xFFFF, 0
            )
        speed = round(math.hypot(*self.body.velocity[:2]) * 100.0)
        return mavlink.MAVLink_gps_raw_int_message(
            round(self.now_s * 1e6),
            self.gps_fix,
            latitude,
            longitude,
            altitude,
            70,
            90,
            speed,
            0xFFFF,
            10,
            alt_ellipsoid=altitude + round(GEOID_SEPARATION_M * 1e3),
            h_acc=900,
            v_acc=1780,
        )

    gps_fix = mavlink.GPS_FIX_TYPE_3D_FIX

    def _origin(self) -> Message | None:
        if not self.has_satellites:
            return None
        latitude, longitude, altitude = self.geo((0.0, 0.0, 0.0))
        return mavlink.MAVLink_gps_global_origin_message(latitude, longitude, altitude, round(self.now_s * 1e6))

    def _home_position(self) -> Message | None:
        if self.home is None:
            return None
        return mavlink.MAVLink_home_position_message(
            *self.geo(self.home), *self.home, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, round(self.now_s * 1e6)
        )

    def _sys_status(self) -> Message:
        present = 33570863 | mavlink.MAV_SYS_STATUS_PREARM_CHECK | mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
        present |= self.failing_sensors | self.more_sensors
        health = present if self.is_ready_to_arm else present & ~mavlink.MAV_SYS_STATUS_PREARM_CHECK
        health &= ~(self.failing_sensors | self.unmeasured_sensors)
        return mavlink.MAVLink_sys_status_message(present, present, health, 300, 16200, 1000, 90, 0, 0, 0, 0, 0, 0)

    @property
    def more_sensors(self) -> int:
        """Sensors (MAV_SYS_STATUS_SENSOR) that it has beside the usual ones."""
        return 0

    @property
    def unmeasured_sensors(self) -> int:
        """Sensors that it does not call healthy yet, as it has just booted."""
        return 0

    def _extended_sys_state(self) -> Message:
        return mavlink.MAVLink_extended_sys_state_message(self.vtol_state, self.landed_state)

    vtol_state = mavlink.MAV_VTOL_STATE_UNDEFINED

    def _battery_status(self) -> Message:
        """Tells of one battery after the other."""
        self.batteries.append(self.batteries.pop(0))
        number, function, percent = self.batteries[-1]
        cells = [4050] * 4 + [0xFFFF] * 6
        return mavlink.MAVLink_battery_status_message(number, function, 0, 0x7FFF, cells, 1000, 0, 0, percent)

    def _autopilot_version(self) -> Message:
        return mavlink.MAVLink_autopilot_version_message(
            59647, self.flight_sw_version, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, self.uid
        )

    uid = 0


def _ids(sender: Sender) -> tuple[int, int]:
    return sender.system_id, sender.component_id


def filler(message_id: int) -> Callable[[], Any]:
    """Returns a function that makes a message of zeros. Nobody uses it, but it takes up the link like the real one."""
    kind = mavlink.mavlink_map[message_id]
    values: list[Any] = []
    for name in kind.fieldnames:
        at = kind.ordered_fieldnames.index(name)
        length = kind.array_lengths[at]
        if kind.fieldtypes[kind.fieldnames.index(name)] == "char":
            values.append(b"")
        else:
            values.append([0] * length if length else 0)
    return lambda: kind(*values)
