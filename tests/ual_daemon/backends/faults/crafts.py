"""The simulated vehicles of all backends, as `Craft`s."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from typing_extensions import override

from tests.simulators.airsim import Vehicle
from tests.simulators.airsim_server import AirsimServer, Peer
from tests.simulators.ardupilot import ArduPilot
from tests.simulators.autopilot import SET_MODE, Autopilot
from tests.simulators.crazyflie import Crazyflie
from tests.simulators.dji import RC, STEP_S
from tests.simulators.faults import BadLink, Faults
from tests.simulators.lockstep import LockstepBackend
from tests.simulators.lockstep_airsim import LockstepAirsim
from tests.simulators.lockstep_crazyflie import LockstepCrazyflie, SteppedLink
from tests.simulators.lockstep_dji import LockstepDji, LockstepOsdkVehicle, LockstepPsdk
from tests.simulators.lockstep_hover import LockstepHover
from tests.simulators.lockstep_mavros import LockstepMavros
from tests.simulators.pace import Pace
from tests.simulators.ports import MemoryPort
from tests.simulators.px4 import Px4
from tests.simulators.rosbridge import Answer, Message
from tests.ual_daemon.backends.faults.craft import Can, Craft, ObservedState
from ual.simulation import Command, CommandRefused, LinkLost
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.crazyflie.packets import HIGH_LEVEL, LAND, PLATFORM, SET_ARMED, SETPOINT, CrtpPacket
from ual_daemon.backends.light import LightBackend
from ual_daemon.backends.values import Setpoint

OPTIONS = BackendOptions("uav_1")
SPEED = 40.0
SILENT = Faults(is_silent=True)
FLYING = {
    mavlink.MAV_CMD_DO_SET_MODE: "mode",
    SET_MODE: "mode",
    mavlink.MAV_CMD_NAV_LAND: "land",
    mavlink.MAV_CMD_NAV_TAKEOFF: "take_off",
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: "arm",
}


def scripted(craft: Craft, pace: Pace) -> None:
    """Has a script played before each step of what a pace steps."""
    wait = pace.wait

    def wait_and_play() -> None:
        wait()
        craft.step_script()

    pace.wait = wait_and_play  # type: ignore[method-assign]


class OnBadLink(Craft):
    """On a link that loses what the vehicle says."""

    link: BadLink

    @override
    def be_silent(self, *, does: bool) -> None:
        self.link.down = SILENT if does else Faults()


class OnRosbridge(Craft):
    """Behind a bridge of ROS, which passes nothing on where it is silent."""

    ros: LockstepMavros | LockstepDji

    @override
    def be_silent(self, *, does: bool) -> None:
        topics = set(self.ros.bridge.nodes[0].topics)
        self.ros.bridge.faults.silent_topics = topics if does else set()

    @override
    def hold_up(self, *, does: bool = True) -> None:
        self.ros.is_socket_full = does


class OfAutopilot(Craft):
    """A PX4 or an ArduCopter."""

    autopilot: Autopilot

    def visible_to_autopilot(self) -> ObservedState:
        autopilot = self.autopilot
        return ObservedState(
            lambda: autopilot.elapsed_s,
            lambda: autopilot.setpoints_s,
            lambda: [(each[0], FLYING[each[1]]) for each in autopilot.commands if each[1] in FLYING],
        )

    @override
    def ready(self) -> None:
        self.autopilot.pilot_readies()
        super().ready()

    @override
    def pilot_takes_over(self) -> None:
        self.autopilot.pilot_take_over()

    @override
    def pilot_disarms(self) -> None:
        assert self.autopilot.pilot_disarm()

    @override
    def reboot(self) -> None:
        self.autopilot.reboot()

    @override
    def ignore(self, *, does: bool = True) -> None:
        self.autopilot.ignored = set(FLYING) if does else set()

    @override
    def refuse(self, text: str) -> None:
        self.autopilot.arm_refusal = text


class OfMavlink(OnBadLink, OfAutopilot):
    """Through MAVLink, over a link that can fall silent."""

    can = frozenset(Can) - {Can.BE_HELD_UP}
    kind: ClassVar[type[Px4 | ArduPilot]]

    def __init__(self, _: Path) -> None:
        port = MemoryPort()
        self.link = BadLink(port, 0)
        self.autopilot = Px4(self.link, is_terse=True) if self.kind is Px4 else ArduPilot(self.link)
        backend = LockstepBackend(OPTIONS, self.autopilot, port, SPEED)
        backend.looks_each_step = True
        super().__init__(backend, self.visible_to_autopilot())
        scripted(self, backend.connection._pace)

    @override
    def advance(self) -> None:
        self.autopilot.step()


class MavlinkPx4(OfMavlink):
    kind = Px4


class MavlinkArduPilot(OfMavlink):
    kind = ArduPilot


class OfMavros(OnRosbridge, OfAutopilot):
    """Through MAVROS, which may stall while the bridge does not."""

    can = frozenset(Can)
    seen_s = 1.2  # MAVROS tells the mode with the heartbeat: once a second
    kind: ClassVar[type[Px4 | ArduPilot]]
    ros_version: ClassVar[int]

    def __init__(self, _: Path) -> None:
        port = MemoryPort()
        self.autopilot = Px4(port, is_terse=True) if self.kind is Px4 else ArduPilot(port)
        self.ros = LockstepMavros(OPTIONS, self.autopilot, port, self.ros_version, SPEED)
        super().__init__(self.ros, self.visible_to_autopilot())
        scripted(self, self.ros._pace)

    @override
    def advance(self) -> None:
        self.ros.bridge.step(self.now_s + STEP_S)


class MavrosPx4(OfMavros):
    kind, ros_version = Px4, 2


class MavrosArduPilot(OfMavros):
    kind, ros_version = ArduPilot, 1


_NO_COMMANDS = ("/rosapi", "joystick_action", "release", "camera_get_type")
"""Calls of DJI's that ask, or let go."""


class OfDji(OnRosbridge):
    """A DJI aircraft behind a wrapper."""

    can = frozenset(Can) - {Can.REBOOT, Can.REPEAT}
    kind: ClassVar[type[LockstepDji]]
    height_m = 3.0
    seen_s = 0.25

    def __init__(self, _: Path) -> None:
        self.dji = self.ros = self.kind(OPTIONS, SPEED)
        self._called: list[tuple[float, str]] = []
        call = self.dji.bridge.call

        def note(name: str, arguments: Message) -> Answer:
            if not any(each in name for each in _NO_COMMANDS):
                self._called.append((self.now_s, name))
            return call(name, arguments)

        self.dji.bridge.call = note  # type: ignore[method-assign]
        aircraft = self.dji.aircraft
        super().__init__(
            self.dji,
            ObservedState(
                lambda: self.dji.bridge.now_s,
                lambda: [time_s for time_s, _, _ in aircraft.setpoints],
                lambda: self._called,
            ),
        )
        scripted(self, self.dji._pace)

    @override
    def advance(self) -> None:
        with self.dji.lock:
            self.dji.bridge.step(self.now_s + STEP_S)

    @override
    def pilot_takes_over(self) -> None:
        self.dji.aircraft.pilot_takes_over()

    @override
    def pilot_disarms(self) -> None:
        assert self.dji.aircraft.body.is_on_ground
        self.dji.aircraft.device, self.dji.aircraft.has_motors = RC, False

    @override
    def ignore(self, *, does: bool = True) -> None:
        services = self.dji.bridge.nodes[0].services
        self.dji.bridge.faults.dead_services = set(services) if does else set()

    @override
    def refuse(self, text: str) -> None:
        self.dji.aircraft.refusal = text


class DjiPsdk(OfDji):
    kind = LockstepPsdk


class DjiOsdkVehicle(OfDji):
    """It lands by setpoints."""

    can = OfDji.can - {Can.IGNORE}
    kind = LockstepOsdkVehicle


class OfCrazyflie(OnBadLink):
    """A Crazyflie, which nobody but UAL can fly."""

    can = frozenset((Can.BE_UNHEARD, Can.REBOOT, Can.IGNORE, Can.REPEAT, Can.STALL))
    height_m = 1.0

    def __init__(self, cache: Path) -> None:
        memory = MemoryPort()
        self.link = BadLink(memory, 0)
        self.crazyflie = Crazyflie(memory)
        self.crazyflie.port = self.link
        self._received: list[tuple[float, CrtpPacket]] = []
        take = self.crazyflie._take

        def note(raw: bytes) -> None:
            packet = CrtpPacket.decode(raw)
            if packet is not None:
                self._received.append((self.now_s, packet))
            take(raw)

        self.crazyflie._take = note  # type: ignore[method-assign]
        options = BackendOptions("uav_1", None, {"cache_directory": str(cache)})
        backend = LockstepCrazyflie(options, self.crazyflie, memory, SPEED)
        super().__init__(backend, ObservedState(lambda: self.crazyflie.elapsed_s, self._hovered_s, self._commanded))
        link = backend._link
        assert isinstance(link, SteppedLink)
        scripted(self, link._pace)

    @override
    def advance(self) -> None:
        self.crazyflie.step()

    def _hovered_s(self) -> list[float]:
        return [time_s for time_s, each in list(self._received) if (each.port, each.channel) == (SETPOINT, 0)]

    def _commanded(self) -> list[tuple[float, str]]:
        named = ((time_s, _name(each)) for time_s, each in list(self._received))
        return [(time_s, name) for time_s, name in named if name]

    @override
    def pilot_disarms(self) -> None:
        """It has no pilot: another program disarms it."""
        self.crazyflie._on_arm(PLATFORM, 0, bytes((SET_ARMED, 0)))

    @override
    def reboot(self) -> None:
        self.crazyflie.boot()

    @override
    def ignore(self, *, does: bool = True) -> None:
        self.crazyflie.ignored = {HIGH_LEVEL, PLATFORM} if does else set()


def _name(packet: CrtpPacket) -> str:
    """Returns the name of a command; nothing for a hover, which the backend begins by itself."""
    if packet.port == PLATFORM and packet.channel == 0 and packet.data[0] == SET_ARMED:
        return "arm"
    return "land" if packet.port == HIGH_LEVEL and packet.data[0] == LAND else ""


class OfLight(Craft):
    """The light simulation: its link carries nothing either way when it is silent."""

    can = frozenset((Can.BE_UNHEARD, Can.BE_FLOWN_BY_A_PILOT, Can.REFUSE))
    link_s = 1.0

    def __init__(self, _: Path) -> None:
        backend = LightBackend(BackendOptions("uav_1", None, {"speed_factor": SPEED}))
        self.world = backend.world
        self._setpoints_s: list[float] = []
        self._commands: list[tuple[float, str]] = []
        set_setpoint, step_once = self.world.fleet.set_setpoint, self.world._step_once

        def note(index: int, setpoint: Setpoint, now_s: float) -> None:
            self._setpoints_s.append(now_s)
            set_setpoint(index, setpoint, now_s)

        def step(every: int = 1) -> None:
            self.step_script()
            step_once(every)

        self.world.fleet.set_setpoint = note  # type: ignore[method-assign]
        for name in ("_arm", "_disarm", "_guide", "_switch"):
            setattr(backend, name, self._noted(name, getattr(backend, name)))
        self._script = []
        self.world._step_once = step  # type: ignore[method-assign]
        super().__init__(backend, ObservedState(self.world.now_s, lambda: self._setpoints_s, lambda: self._commands))

    def _noted(self, name: str, action: Callable[..., str | None]) -> Callable[..., str | None]:
        def noted(*arguments: object) -> str | None:
            self._commands.append((self.now_s, name.strip("_")))
            return action(*arguments)

        return noted

    @override
    def advance(self) -> None:
        raise NotImplementedError

    @override
    def be_silent(self, *, does: bool) -> None:
        if does:
            self.uav.simulation.begin_fault(LinkLost())
        else:
            self.uav.simulation.end_fault()

    @override
    def pilot_takes_over(self) -> None:
        self.uav.simulation.pilot_take_over()
        self._commands.clear()

    @override
    def pilot_disarms(self) -> None:
        self.uav.simulation.pilot_disarm()
        self._commands.clear()

    @override
    def refuse(self, text: str) -> None:
        self.uav.simulation.begin_fault(CommandRefused(Command.ANY, text))


class OfHover(Craft):
    """The example of a third party's backend."""

    can = frozenset(Can) - {Can.BE_HELD_UP}

    def __init__(self, _: Path) -> None:
        self.hover = LockstepHover(OPTIONS, SPEED)
        device = self.hover.device
        super().__init__(
            self.hover, ObservedState(lambda: device.elapsed_s, lambda: device.targets_s, lambda: device.commands)
        )
        scripted(self, self.hover.device.pace)

    @override
    def advance(self) -> None:
        self.hover.device.advance()

    @override
    def be_silent(self, *, does: bool) -> None:
        self.hover.device.is_silent = does

    @override
    def pilot_takes_over(self) -> None:
        self.hover.device.pilot_switches("hold")

    @override
    def pilot_disarms(self) -> None:
        self.hover.device.pilot_switches("disarm")

    @override
    def reboot(self) -> None:
        self.hover.device.boot()

    @override
    def ignore(self, *, does: bool = True) -> None:
        self.hover.device.ignores = does

    @override
    def refuse(self, text: str) -> None:
        self.hover.device.refusal = text


class OfAirsim(Craft):
    """AirSim, whose pilot takes over by ending the control of its API. It lands by setpoints."""

    can = frozenset((Can.BE_UNHEARD, Can.BE_FLOWN_BY_A_PILOT, Can.STALL))
    link_s = 2.2

    def __init__(self, _: Path) -> None:
        self.vehicle = Vehicle("Drone1")
        self._setpoints_s: list[float] = []
        self._commands: list[tuple[float, str]] = []
        self.server = AirsimServer([self.vehicle], clock_speed=SPEED)
        begin = self.server._begin

        def note(peer: Peer, number: int, method: str, arguments: list[Any]) -> None:
            if method == "moveByVelocity":
                self._setpoints_s.append(self.now_s)
            elif method in ("enableApiControl", "armDisarm"):
                self._commands.append((self.now_s, method))
            begin(peer, number, method, arguments)

        self.server._begin = note  # type: ignore[method-assign]
        seen = ObservedState(lambda: self.vehicle.now_s, lambda: self._setpoints_s, lambda: self._commands)
        super().__init__(LockstepAirsim(OPTIONS, self.server, self.vehicle), seen)
        self.server.on_step = self.step_script

    @override
    def close(self) -> None:
        super().close()
        self.server.close()

    @override
    def advance(self) -> None:
        self.server.run(STEP_S)

    @override
    def be_silent(self, *, does: bool) -> None:
        self.server.is_silent = does

    @override
    def pilot_takes_over(self) -> None:
        """With the throttle in the middle: it hovers."""
        self.vehicle.rc = {"is_valid": True, "pitch": 0.0, "roll": 0.0, "yaw": 0.0, "throttle": 0.61}
        self.vehicle.enable_api_control(False)

    @override
    def pilot_disarms(self) -> None:
        assert self.vehicle.disarm()


CRAFTS: dict[str, type[Craft]] = {
    "px4": MavlinkPx4,
    "ardupilot": MavlinkArduPilot,
    "mavros px4": MavrosPx4,
    "mavros ardupilot": MavrosArduPilot,
    "dji psdk": DjiPsdk,
    "dji osdk": DjiOsdkVehicle,
    "airsim": OfAirsim,
    "crazyflie": OfCrazyflie,
    "light": OfLight,
    "hover": OfHover,
}
