"""A simulated Crazyflie: speaks CRTP as the firmware does, and flies as its simulator was measured.

Tables of contents, log blocks, parameters, both commanders, the supervisor and its time-outs. Any difference to the
firmware is a defect. ``python -m tests.simulators crazyflie`` runs one in a process of its own.
"""

from __future__ import annotations

import math
import struct
import threading
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from tests.simulators.physics import ZERO, Agility, Body, Target, Vector, control
from tests.simulators.ports import Port
from ual.geometry import Quaternion
from ual_daemon.backends.crazyflie.packets import CrtpPacket, compress, decompress

STEP_S = 0.01
LEVEL_OUT_S, STOP_S = 0.5, 2.0
"""Without low-level setpoints for so long it levels out, and stops its motors."""
FLYING_S = 2.0
"""Seconds after the stop of its motors for which it says that it flies."""
LANDED_S = 3.0
"""Seconds on the ground after which it disarms itself."""
LEAST_THRUST = 20000
"""On the ground, with a goal below it."""
REST_Z_M = 0.014
ENOENT, E2BIG, ENOEXEC, EEXIST = 2, 7, 8, 17
_RATE_S = 0.02
_AGILITY = Agility(2.0, 2.0, 6.0, 8.0, 1.1, 1.1, 1.1, 3.5, 4.0, 40.0, 6.0, 3.5)
_IDENT = struct.Struct("<H")
_UNSURE_M2 = 4.0
_FORMATS = {"B": 1, "H": 2, "I": 3, "b": 4, "h": 5, "i": 6, "f": 7, "e": 8}
_LETTERS = {number: letter for letter, number in _FORMATS.items()}
_PARAMETER_TYPES = {"B": 8, "H": 9, "I": 10, "f": 6}


class Supervisor(Enum):
    """The states of the firmware's supervisor."""

    CHECKS = "preFlChecksNotPassed"
    PASSED = "preFlChecksPassed"
    READY = "readyToFly"
    FLYING = "flying"
    LANDED = "landed"
    LEVEL_OUT = "warningLevelOut"
    CRASHED = "crashed"
    LOCKED = "locked"


_MAY_FLY = (Supervisor.READY, Supervisor.FLYING, Supervisor.LANDED, Supervisor.LEVEL_OUT)
_IN_FLIGHT = (Supervisor.FLYING, Supervisor.LEVEL_OUT)


@dataclass(slots=True)
class Plan:
    """A flight of the high-level commander: from a place and velocity to a place, at rest."""

    begin_s: float
    duration_s: float
    start: Vector
    velocity: Vector
    goal: Vector
    yaw_start_rad: float
    yaw_goal_rad: float
    is_landing: bool = False

    def at(self, now_s: float) -> tuple[Vector, float]:
        """Returns the place and heading at a time."""
        part = min(1.0, (now_s - self.begin_s) / self.duration_s)
        done = part**4 * (35.0 - 84.0 * part + 70.0 * part**2 - 20.0 * part**3)
        glide_s = self.duration_s * part * (1.0 - part) ** 4
        place = tuple(
            a + v * glide_s + (b - a) * done for a, v, b in zip(self.start, self.velocity, self.goal, strict=True)
        )
        turn = math.remainder(self.yaw_goal_rad - self.yaw_start_rad, math.tau)
        return place, self.yaw_start_rad + turn * done  # type: ignore[return-value]


@dataclass(slots=True)
class Block:
    """A log block: its variables with the letters of their types, and when the next packet is due."""

    variables: list[tuple[str, str]]
    period_s: float = 0.0
    due_s: float = math.inf

    @property
    def size(self) -> int:
        return struct.calcsize("<" + "".join(letter for _, letter in self.variables))


class Crazyflie:
    """One Crazyflie. Its time stands still until `step` is called. Places are x, y, z (m), z up.

    `arms_itself` is the Crazyflie 2.1; the 2.1 Brushless must be armed. `protocol` is the version of CRTP.
    """

    def __init__(
        self,
        port: Port,
        *,
        start: Vector = (0.0, 0.0, REST_Z_M),
        arms_itself: bool = False,
        protocol: int = 7,
        has_battery: bool = True,
    ) -> None:
        self.lock = threading.RLock()
        self.port = port
        self.protocol = protocol
        self.arms_itself = arms_itself
        self.body = Body(position=_ned(start), ground_z_m=-start[2])
        self.has_positioning = True
        """Whether something tells it where it is."""
        self.is_tumbled = False
        self.power_state = 0
        self.ignored: set[int] = set()
        """Ports that it does not listen to, for tests without an answer."""
        self.is_silent = False
        """Whether nothing comes through, either way."""
        self.elapsed_s = 0.0
        self.received: list[tuple[float, CrtpPacket]] = []
        """All packets for it, with their times."""
        self.external_poses: list[tuple[Vector, Quaternion]] = []
        self.logged: dict[str, tuple[str, Callable[[], float]]] = self._variables()
        if not has_battery:
            self.logged = {name: each for name, each in self.logged.items() if not name.startswith("pm.")}
        self.parameters: dict[str, tuple[str, float, bool]] = dict(_PARAMETERS)
        self.boot()

    def boot(self) -> None:
        """Resets it to the state after switching on. The estimator keeps its place, as poses from outside tell it."""
        with self.lock:
            self.now_s = 0.0
            self.supervisor = Supervisor.CHECKS
            self.is_armed = self.is_crashed = False
            self.setpoint: Target | None = None
            self.setpoint_s = -math.inf
            self.has_priority = False
            self.plan: Plan | None = None
            self.thrust = 0
            self._thrust_s = self._landed_s = -math.inf
            self._fixed_s = 0.0
            self.blocks: dict[int, Block] = {}
            for name, entry in _PARAMETERS.items():
                if not entry[2]:
                    self.parameters[name] = entry
            self.say("SYS: Crazyflie is up and running!")

    # --- Time ---------------------------------------------------------------------------------------------------------

    def step(self) -> None:
        """Advances its time by a hundredth of a second."""
        with self.lock:
            self.now_s += STEP_S
            self.elapsed_s += STEP_S
            for data in self.port.receive(self.elapsed_s):
                self._take(data)
            self._supervise()
            self._fly()
            self._log()

    def close(self) -> None:
        self.port.close()

    def run(self, duration_s: float) -> None:
        """Steps for so long."""
        for _ in range(round(duration_s / STEP_S)):
            self.step()

    # --- Flight -------------------------------------------------------------------------------------------------------

    @property
    def current_position(self) -> Vector:
        x, y, z = self.body.position
        return x, -y, -z

    @property
    def velocity(self) -> Vector:
        x, y, z = self.body.velocity
        return x, -y, -z

    @property
    def yaw_rad(self) -> float:
        return -self.body.yaw_rad

    @property
    def info(self) -> int:
        """The bits of ``supervisor.info``."""
        bits = (
            self.supervisor is Supervisor.PASSED,
            self.is_armed,
            self.arms_itself,
            self.supervisor in _MAY_FLY,
            self.supervisor in _IN_FLIGHT,
            self.is_tumbled,
            self.supervisor is Supervisor.LOCKED,
            self.is_crashed,
        )
        return sum(1 << index for index, bit in enumerate(bits) if bit)

    def _supervise(self) -> None:
        age_s = self.now_s - self.setpoint_s if self.has_priority else 0.0
        is_flying = self.now_s - self._thrust_s < FLYING_S
        state = self.supervisor
        if state is Supervisor.CHECKS and not self.is_tumbled:
            state = Supervisor.PASSED
            self.is_armed = self.is_armed or self.arms_itself
        elif state is Supervisor.PASSED:
            state = Supervisor.CHECKS if self.is_tumbled else Supervisor.READY if self.is_armed else state
        elif state is Supervisor.READY:
            is_off = self.is_tumbled or not self.is_armed
            state = Supervisor.CHECKS if is_off else Supervisor.FLYING if is_flying else state
        elif state in _IN_FLIGHT:
            state = self._judge_flight(age_s, is_flying=is_flying)
        elif state is Supervisor.LANDED:
            is_over = self.now_s - self._landed_s > LANDED_S
            state = Supervisor.FLYING if is_flying else Supervisor.CHECKS if is_over else state
        if state is not self.supervisor:
            self._enter(state)

    def _judge_flight(self, age_s: float, *, is_flying: bool) -> Supervisor:
        if self.is_tumbled:
            return Supervisor.CRASHED
        if age_s > STOP_S or not self.is_armed:
            return Supervisor.LOCKED
        if not is_flying:
            return Supervisor.LANDED
        return Supervisor.LEVEL_OUT if age_s > LEVEL_OUT_S else Supervisor.FLYING

    def _enter(self, state: Supervisor) -> None:
        self.supervisor = state
        if state is Supervisor.LANDED:
            self._landed_s = self.now_s
        if state not in (*_MAY_FLY, Supervisor.PASSED):
            self.is_armed = False
        if state is Supervisor.LOCKED:
            self.say("SUP: Locked, reboot required")
        if state is Supervisor.CRASHED:
            self.is_crashed = True
            self.say("SUP: Crashed, recovery required")

    def _fly(self) -> None:
        target = self._target() if self.supervisor in _MAY_FLY else None
        if target is None:
            self.thrust = 0
            self.body.fall(STEP_S)
            return
        self.thrust, self._thrust_s = 38800, self.now_s
        if self.supervisor is Supervisor.LEVEL_OUT:
            vx, vy, _ = self.body.velocity
            target = Target(position=(None, None, target.position[2]), velocity=(vx, vy, 0.0))
        acceleration, yaw_rate = control(_AGILITY, target, self.body.position, self.body.velocity, self.body.yaw_rad)
        self.body.fly(acceleration, yaw_rate, _AGILITY.jerk_m_s3, STEP_S)
        down = target.position[2]
        if self.body.is_on_ground and down is not None and down > self.body.ground_z_m:
            self.thrust = LEAST_THRUST

    def _target(self) -> Target | None:
        """Returns what the commander with the priority wants; None: motors off."""
        if self.has_priority:
            return self.setpoint
        plan = self.plan
        if plan is None or self.parameters["commander.enHighLevel"][1] == 0.0:
            return None
        if plan.is_landing and self.now_s >= plan.begin_s + plan.duration_s:
            self.plan = None
            return None
        place, yaw_rad = plan.at(self.now_s)
        return Target(position=_ned(place), yaw_rad=-yaw_rad)

    # --- Packets ------------------------------------------------------------------------------------------------------

    def say(self, text: str) -> None:
        """Says a line on the console, in pieces."""
        data = text.encode() + b"\n"
        for first in range(0, len(data), 30):
            self._send(0, 0, data[first : first + 30])

    def _send(self, port: int, channel: int, data: bytes) -> None:
        if not self.is_silent:
            self.port.send(CrtpPacket(port, channel, data).encode(), self.elapsed_s)

    def _take(self, raw: bytes) -> None:
        packet = CrtpPacket.decode(raw)
        if self.is_silent or packet is None or packet.port in self.ignored:
            return
        self.received.append((self.elapsed_s, packet))
        handlers: dict[tuple[int, int], Callable[[bytes], None]] = {
            (2, 0): lambda data: self._on_toc(2, data),
            (2, 1): self._on_read,
            (2, 2): self._on_write,
            (5, 0): lambda data: self._on_toc(5, data),
            (5, 1): self._on_log_control,
            (6, 0): self._on_position,
            (6, 1): self._on_localization,
            (7, 0): self._on_setpoint,
            (7, 1): self._on_setpoints_stop,
            (8, 0): self._on_high_level,
            (9, 1): lambda data: self._on_arm(9, 1, data),
            (13, 0): lambda data: self._on_arm(13, 0, data),
            (13, 1): self._on_version,
        }
        handler = handlers.get((packet.port, packet.channel))
        if handler is not None:
            handler(packet.data)

    def _on_version(self, data: bytes) -> None:
        answer = struct.pack("<I", self.protocol) if data[0] == 0 else b"2024.2\0"
        self._send(13, 1, data[:1] + answer)

    def _on_arm(self, port: int, channel: int, data: bytes) -> None:
        if (port == 9) is not (self.protocol >= 12) or data[0] != 1:
            return
        wanted = bool(data[1])
        is_done = wanted == self.is_armed or not wanted or self.supervisor is Supervisor.PASSED
        if is_done:
            self.is_armed = wanted
        head = data[0] | (0x80 if port == 9 else 0)
        self._send(port, channel, bytes((head, is_done, self.is_armed)))

    # Tables of contents

    def _on_toc(self, port: int, data: bytes) -> None:
        table = self.logged if port == 5 else self.parameters
        if data[0] == 3:
            checksum = zlib.crc32("\n".join(table).encode())
            self._send(port, 0, struct.pack("<BHI", 3, len(table), checksum) + (b"\x10\x80" if port == 5 else b""))
        elif data[0] == 2:
            (ident,) = _IDENT.unpack_from(data, 1)
            if ident >= len(table):
                self._send(port, 0, data[:1])
                return
            name = list(table)[ident]
            group, _, variable = name.partition(".")
            self._send(port, 0, data[:3] + bytes((self._type(port, name),)) + f"{group}\0{variable}\0".encode())

    def _type(self, port: int, name: str) -> int:
        if port == 5:
            return _FORMATS[self.logged[name][0]]
        letter, _, is_read_only = self.parameters[name]
        return _PARAMETER_TYPES[letter] | (0x40 if is_read_only else 0)

    # Parameters

    def _on_read(self, data: bytes) -> None:
        name = self._parameter(data)
        if name is None:
            self._send(2, 1, data[:2] + bytes((ENOENT,)))
        else:
            self._send(2, 1, data[:2] + b"\0" + self._packed(name))

    def _on_write(self, data: bytes) -> None:
        name = self._parameter(data)
        if name is None:
            self._send(2, 2, data[:2] + bytes((ENOENT,)))
            return
        letter, _, is_read_only = self.parameters[name]
        if not is_read_only:
            self.parameters[name] = letter, struct.unpack_from(f"<{letter}", data, 2)[0], False
            self._send(2, 2, data)

    def _parameter(self, data: bytes) -> str | None:
        (ident,) = _IDENT.unpack_from(data)
        return list(self.parameters)[ident] if ident < len(self.parameters) else None

    def _packed(self, name: str) -> bytes:
        letter, value, _ = self.parameters[name]
        return struct.pack(f"<{letter}", value if letter == "f" else int(value))

    # Logging

    def _on_log_control(self, data: bytes) -> None:
        command, error = data[0], 0
        if command == 5:
            self.blocks.clear()
        elif command == 2:
            error = ENOENT if self.blocks.pop(data[1], None) is None else 0
        elif command in (6, 7):
            error = self._define(data[1], data[2:], is_new=command == 6)
        elif command == 3:
            block = self.blocks.get(data[1])
            error = ENOENT if block is None else 0
            if block is not None:
                block.period_s, block.due_s = data[2] * 0.01, self.now_s
        else:
            error = ENOEXEC
        self._send(5, 1, bytes((command, data[1] if len(data) > 1 else 0, error)))

    def _define(self, ident: int, items: bytes, *, is_new: bool) -> int:
        if is_new and ident in self.blocks:
            return EEXIST
        if not is_new and ident not in self.blocks:
            return ENOENT
        block = self.blocks.setdefault(ident, Block([]))
        for kind, number in struct.iter_unpack("<BH", items):
            if number >= len(self.logged):
                return ENOENT
            block.variables.append((list(self.logged)[number], _LETTERS[kind]))
            if block.size > 26:
                block.variables.pop()
                return E2BIG
        return 0

    def _log(self) -> None:
        for ident, block in list(self.blocks.items()):
            if self.now_s >= block.due_s - 1e-9:
                block.due_s += block.period_s
                stamp = (round(self.now_s * 1000.0) & 0xFFFFFF).to_bytes(3, "little")
                values = b"".join(_pack(letter, self.logged[name][1]()) for name, letter in block.variables)
                self._send(5, 2, bytes((ident,)) + stamp + values)

    def _variables(self) -> dict[str, tuple[str, Callable[[], float]]]:
        axes = range(3)
        found: dict[str, tuple[str, Callable[[], float]]] = {
            "acc.x": ("f", lambda: 0.0),
            "baro.asl": ("f", lambda: 0.0),
            **{f"stateEstimate.{'xyz'[i]}": ("f", lambda i=i: self.current_position[i]) for i in axes},  # type: ignore[misc]
            **{f"stateEstimateZ.v{'xyz'[i]}": ("h", lambda i=i: self.velocity[i] * 1000.0) for i in axes},  # type: ignore[misc]
            "stateEstimateZ.quat": ("I", self._quaternion),
            "stateEstimateZ.rateRoll": ("h", lambda: 0.0),
            "stateEstimateZ.ratePitch": ("h", lambda: 0.0),
            "stateEstimateZ.rateYaw": ("h", lambda: -self.body.yaw_rate_rad_s * 1000.0),
            **{f"kalman.varP{axis}": ("f", self._variance) for axis in "XYZ"},
            "supervisor.info": ("H", lambda: self.info),
            "stabilizer.thrust": ("f", lambda: self.thrust),
            "pm.vbat": ("f", lambda: 3.9),
            "pm.state": ("b", lambda: self.power_state),
            "pm.batteryLevel": ("B", lambda: 80),
        }
        return found

    def _quaternion(self) -> float:
        roll, pitch = self.body.tilt
        return compress(Quaternion.from_euler(roll, -pitch, self.yaw_rad))

    def _variance(self) -> float:
        if self.has_positioning:
            self._fixed_s = self.now_s
        blind_s = self.now_s - self._fixed_s
        return 1e-5 if blind_s < 0.5 else min(100.0, _UNSURE_M2 * blind_s)

    # Commanders and estimator

    def _on_localization(self, data: bytes) -> None:
        if data[0] == 8:
            x, y, z, *orientation = struct.unpack_from("<7f", data, 1)
            self.external_poses.append(((x, y, z), Quaternion(*orientation)))
            self._fixed_s = self.now_s

    def _on_position(self, data: bytes) -> None:
        self.external_poses.append((struct.unpack("<3f", data), Quaternion()))
        self._fixed_s = self.now_s

    def _on_setpoint(self, data: bytes) -> None:
        kind, numbers = data[0], data[1:]
        if kind in (1, 8):
            vx, vy, vz, yaw_rate_deg_s = struct.unpack("<4f", numbers)
            sign = 1.0 if kind == 1 else -1.0  # the old one is positive to the right, as the body's axes here
            self.setpoint = Target(velocity=_ned((vx, vy, vz)), yaw_rate_rad_s=sign * math.radians(yaw_rate_deg_s))
        elif kind == 6:
            values = struct.unpack("<9hI3h", numbers)
            place = _ned(tuple(each / 1000.0 for each in values[:3]))
            self.setpoint = Target(position=place, yaw_rad=-decompress(values[9]).yaw_rad)
        elif kind == 7:
            x, y, z, yaw_deg = struct.unpack("<4f", numbers)
            self.setpoint = Target(position=_ned((x, y, z)), yaw_rad=-math.radians(yaw_deg))
        elif kind == 0:
            self.setpoint = None
        else:
            return
        self.setpoint_s, self.has_priority, self.plan = self.now_s, True, None

    def _on_setpoints_stop(self, _: bytes) -> None:
        self.has_priority = False

    def _on_high_level(self, data: bytes) -> None:
        error = 0
        if data[0] in (4, 12):
            _, _, *flags, x, y, z, yaw_rad, duration_s = struct.unpack("<BB?5f" if data[0] == 4 else "<BB??5f", data)
            goal = tuple(a + b for a, b in zip((x, y, z), self.current_position if flags[0] else ZERO, strict=True))
            self._plan(goal, yaw_rad, duration_s)
        elif data[0] == 8:
            _, _, height_m, yaw_rad, keeps_yaw, duration_s = struct.unpack("<BBff?f", data)
            if self.plan is not None and self.plan.is_landing:
                error = 1
            else:
                x, y, _ = self._position_of_plan()
                self._plan((x, y, height_m), self.yaw_rad if keeps_yaw else yaw_rad, duration_s, is_landing=True)
        elif data[0] == 3:
            self.plan = None
        else:
            error = ENOEXEC
        self._send(8, 0, (data[:3] + b"\0\0\0")[:3] + bytes((error,)))

    def _position_of_plan(self) -> Vector:
        return self.current_position if self.plan is None else self.plan.at(self.now_s)[0]

    def _plan(self, goal: Vector, yaw_rad: float, duration_s: float, *, is_landing: bool = False) -> None:
        velocity = self.velocity if self.plan is None and not is_landing else ZERO
        start = self._position_of_plan()
        self.plan = Plan(self.now_s, duration_s, start, velocity, goal, self.yaw_rad, yaw_rad, is_landing)


_PARAMETERS: dict[str, tuple[str, float, bool]] = {
    "activeMarker.mode": ("B", 0, False),
    "commander.enHighLevel": ("B", 0, False),
    "deck.bcFlow2": ("B", 0, True),
    "deck.bcLighthouse4": ("B", 0, True),
    "pid_attitude.yaw_kp": ("f", 6.0, False),
    **{f"posCtlPid.{axis}Kp": ("f", 2.0, False) for axis in "xyz"},
    **{f"posCtlPid.{axis}VelMax": ("f", 1.0, False) for axis in "xyz"},
    "stabilizer.controller": ("B", 1, False),
    "stabilizer.estimator": ("B", 2, False),
}
"""Type, default, and whether it is read-only."""


def _ned(place: Vector) -> Vector:
    """Converts the axes of the firmware (x, y to the left of it, z up) to those of the physics."""
    return place[0], -place[1], -place[2]


def _pack(letter: str, value: float) -> bytes:
    return struct.pack(f"<{letter}", value if letter in "fe" else round(value))
