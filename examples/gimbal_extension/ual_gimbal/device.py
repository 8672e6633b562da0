"""What turns: a simulated gimbal, or one that a MAVLink autopilot manages (the gimbal protocol, version 2)."""

from __future__ import annotations

import math
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass

from ual.errors import WrongStateError
from ual.geometry import Quaternion, wrap_angle
from ual_daemon.backends.payload import Payload, PayloadMessage
from ual_gimbal.interface import Attitude

_PITCHYAW = 1000
"""MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW: pitch (deg, up), yaw (deg, right), rates, flags, device (0: all)."""
_CONFIGURE = 1001
"""MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE: system and component in primary control; -2 takes it."""
_TAKE_CONTROL = (-2.0, -2.0, -1.0, -1.0, 0.0, 0.0, 0.0)
_HORIZON = 4 + 8
"""GIMBAL_MANAGER_FLAGS_ROLL_LOCK and _PITCH_LOCK: level, and pitch from the horizon; yaw goes with the nose."""
_STATUS = "GIMBAL_DEVICE_ATTITUDE_STATUS"
_YAW_LOCK, _YAW_IN_EARTH_FRAME = 16, 64
"""GIMBAL_DEVICE_FLAGS: the yaw in the status counts from north."""
_STATUS_HZ = 10.0
_OLD_S = 2.0


class Device(ABC):
    """A gimbal. Any thread may call, and nothing blocks."""

    @abstractmethod
    def attitude(self) -> Attitude:
        """Returns where it points. Raises `WrongStateError` where it has not said anything lately."""

    @abstractmethod
    def point(self, goal: Attitude) -> Future[None]:
        """Points somewhere. The future ends when that was accepted."""

    @abstractmethod
    def start(self) -> None:
        """Begins to listen to it."""

    @abstractmethod
    def close(self) -> None:
        """Ends that."""


@dataclass(frozen=True)
class _Turn:
    start: Attitude
    goal: Attitude
    began_s: float


class SimulatedDevice(Device):
    """Turns at a constant speed."""

    def __init__(self, speed_rad_s: float) -> None:
        self._speed_rad_s = speed_rad_s
        self._turn = _Turn(Attitude(0.0, 0.0), Attitude(0.0, 0.0), time.monotonic())

    def attitude(self) -> Attitude:
        turn = self._turn
        far_rad = self._speed_rad_s * (time.monotonic() - turn.began_s)
        return Attitude(
            turn.start.pitch_rad + _within(turn.goal.pitch_rad - turn.start.pitch_rad, far_rad),
            wrap_angle(turn.start.yaw_rad + _within(wrap_angle(turn.goal.yaw_rad - turn.start.yaw_rad), far_rad)),
        )

    def point(self, goal: Attitude) -> Future[None]:
        self._turn = _Turn(self.attitude(), goal, time.monotonic())
        done: Future[None] = Future()
        done.set_result(None)
        return done

    def start(self) -> None:
        return None

    def close(self) -> None:
        return None


class MavlinkDevice(Device):
    """A gimbal that the autopilot manages. Takes control of it with the first command."""

    def __init__(self, payload: Payload, heading_rad: Callable[[], float]) -> None:
        """`heading_rad` returns the UAV's heading, counter-clockwise from east: for gimbals that count from north."""
        self._payload = payload
        self._heading_rad = heading_rad
        self._said: tuple[Attitude, float] | None = None
        self._has_control = False
        self._lock = threading.Lock()
        self._unsubscribe: Callable[[], None] = lambda: None

    def start(self) -> None:
        self._unsubscribe = self._payload.subscribe(_STATUS, self._on_status)
        self._request()

    def close(self) -> None:
        self._unsubscribe()

    def attitude(self) -> Attitude:
        said = self._said
        if said is None or time.monotonic() - said[1] > _OLD_S:
            self._request()  # the autopilot may have been restarted
            raise WrongStateError("the gimbal has not said where it points", {"needed": _STATUS})
        return said[0]

    def point(self, goal: Attitude) -> Future[None]:
        with self._lock:
            if not self._has_control:
                self._payload.send_command(_CONFIGURE, _TAKE_CONTROL)
                self._has_control = True
        pitch_deg, yaw_right_deg = math.degrees(goal.pitch_rad), -math.degrees(goal.yaw_rad)
        return self._payload.send_command(_PITCHYAW, (pitch_deg, yaw_right_deg, math.nan, math.nan, _HORIZON, 0.0, 0.0))

    def _request(self) -> None:
        self._payload.request_message(_STATUS, _STATUS_HZ)

    def _on_status(self, message: PayloadMessage) -> None:
        w, x, y, z = message.fields["q"]
        _, pitch_rad, yaw_right_rad = Quaternion(x, y, z, w).to_euler()  # x ahead, y right, z down
        yaw_rad = -yaw_right_rad
        if message.fields["flags"] & (_YAW_LOCK | _YAW_IN_EARTH_FRAME):
            yaw_rad = wrap_angle(math.pi / 2.0 + yaw_rad - self._heading_rad())
        self._said = Attitude(pitch_rad, yaw_rad), time.monotonic()


def _within(way_rad: float, far_rad: float) -> float:
    return math.copysign(min(abs(way_rad), far_rad), way_rad)
