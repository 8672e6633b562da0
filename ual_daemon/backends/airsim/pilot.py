"""A simulated safety pilot: API control is off, and the vehicle is flown by the sticks of a remote control.

`simple_flight` holds an angle and a thrust by the sticks, and no height. So a person's eyes and hands are simulated,
too: a controller moves the sticks so that the vehicle flies the velocity that is wanted, and hovers with centred ones.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable
from typing import NamedTuple

from ual.geometry import Vector3
from ual_daemon import logs
from ual_daemon.backends.airsim.commands import RefusedError
from ual_daemon.backends.airsim.rpc import RemoteError, RpcCaller, RpcConnection
from ual_daemon.backends.airsim.settings import AirsimAddress
from ual_daemon.backends.airsim.state import AirsimReport, MultirotorState

_log = logging.getLogger(__name__)

_STEERING_PERIOD_S = 0.02
_ANSWER_S = 2.0
_COMMAND_PAUSE_S = 0.1
_SPEED_M_S, _CLIMB_M_S, _TURN_RAD_S = 3.0, 1.5, 1.0
_TILT_PER_M_S, _MOST_TILT = 0.25, 0.6
"""Parts of the stick's travel. All of it is an angle of 33 degrees, which accelerates by 6 m/s^2."""
_HOVER, _THRUST_PER_M_S, _THRUST_PER_M = 0.61, 0.3, 0.3
_YAW_PER_RAD_S = 1.0 / math.pi


class RcSticks(NamedTuple):
    """Positions of the sticks, each from -1 to 1. `turn` is counter-clockwise seen from above."""

    forward: float = 0.0
    left: float = 0.0
    up: float = 0.0
    turn: float = 0.0


class Hands:
    """The controller: from what the pilot wants and sees to the channels of the remote control."""

    def __init__(self) -> None:
        self._throttle = _HOVER

    def channels(
        self, sticks: RcSticks, velocity: Vector3, yaw_rad: float, is_on_ground: bool, step_s: float
    ) -> RcSticks:
        """Returns pitch (forward), roll (to the left), throttle (0 to 1) and yaw (to the left)."""
        if is_on_ground and sticks.up <= 0.0:
            self._throttle = _HOVER
            return RcSticks()
        cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
        forward_m_s, left_m_s = velocity.x * cos + velocity.y * sin, velocity.y * cos - velocity.x * sin
        slow_m_s = sticks.up * _CLIMB_M_S - velocity.z
        self._throttle = min(max(self._throttle + slow_m_s * _THRUST_PER_M * step_s, 0.3), 0.9)
        return RcSticks(
            _tilt(sticks.forward * _SPEED_M_S - forward_m_s),
            _tilt(sticks.left * _SPEED_M_S - left_m_s),
            min(max(self._throttle + slow_m_s * _THRUST_PER_M_S, 0.1), 1.0),
            sticks.turn * _TURN_RAD_S * _YAW_PER_RAD_S,
        )


class AirsimPilot:
    """Moves the sticks of one vehicle while API control is off, on a thread of its own."""

    def __init__(
        self, address: AirsimAddress, vehicle: Callable[[], str], newest: Callable[[], AirsimReport | None]
    ) -> None:
        self._address = address
        self._vehicle = vehicle
        self._newest = newest
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self.sticks = RcSticks()

    @property
    def is_flying(self) -> bool:
        """Whether the sticks are held."""
        return self._thread is not None and self._thread.is_alive() and not self._stopping.is_set()

    def take_over(self, connection: RpcCaller) -> None:
        """Takes the sticks, and switches API control off. Runs on the thread of the commands.

        Raises:
            RefusedError: The vehicle has a remote control of its own, which is the pilot's.
        """
        if not self.is_flying:
            self._require_sticks(connection)
            self._stopping, self.sticks = threading.Event(), RcSticks()
            arguments = (self._stopping, RpcConnection(self._address))
            self._thread = threading.Thread(target=self._fly, args=arguments, name="airsim pilot", daemon=True)
            self._thread.start()
        connection.call(object, _ANSWER_S, "enableApiControl", False, self._vehicle())

    def let_go(self) -> None:
        """Lets the sticks go; API control must be on, or the vehicle falls."""
        self._stopping.set()
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join()

    def _require_sticks(self, connection: RpcCaller) -> None:
        """Tries whether the simulator keeps the sticks that its API moves: not where a real remote control does."""
        report = self._newest()
        if report is not None and report.state.rc_data.is_valid:
            raise RefusedError("the vehicle has a remote control: take over with that")
        connection.call(object, _ANSWER_S, "moveByRC", *_sticks_moved(RcSticks(up=_HOVER), self._vehicle()))
        time.sleep(_COMMAND_PAUSE_S)
        if not connection.call(MultirotorState, _ANSWER_S, "getMultirotorState", self._vehicle()).rc_data.is_valid:
            raise RefusedError("the simulator does not keep the sticks that its API moves (moveByRC)")

    def _fly(self, stopping: threading.Event, connection: RpcConnection) -> None:
        hands, has_taken, timestamp = Hands(), False, 0
        try:
            while not stopping.wait(_STEERING_PERIOD_S):
                report = self._newest()
                if report is None or report.state.timestamp == timestamp:
                    continue
                if report.has_api_control and has_taken:
                    break  # control was taken back
                has_taken = has_taken or not report.has_api_control
                step_s = min((report.state.timestamp - timestamp) * 1e-9, 2 * _STEERING_PERIOD_S)
                timestamp = report.state.timestamp
                self._move(connection, hands, report, step_s)
            connection.call(object, _ANSWER_S, "moveByRC", *_sticks_moved(None, self._vehicle()))
        except (OSError, RemoteError, ValueError) as error:
            logs.event(_log, logging.WARNING, "pilot_ended", why=str(error) or repr(error))
        finally:
            stopping.set()
            connection.close()

    def _move(self, connection: RpcConnection, hands: Hands, report: AirsimReport, step_s: float) -> None:
        is_on_ground = report.state.kinematics_estimated.linear_velocity.norm() < 0.01 and not report.is_flying
        velocity = report.velocity.linear
        channels = hands.channels(self.sticks, velocity, report.pose.yaw_rad, is_on_ground, step_s)
        connection.call(object, _ANSWER_S, "moveByRC", *_sticks_moved(channels, self._vehicle()))


def _tilt(slow_m_s: float) -> float:
    return min(max(slow_m_s * _TILT_PER_M_S, -_MOST_TILT), _MOST_TILT)


def _sticks_moved(channels: RcSticks | None, vehicle: str) -> tuple[object, ...]:
    """Returns the arguments of ``moveByRC``; None: nobody holds the sticks."""
    forward, left, up, turn = channels or RcSticks()
    data: dict[str, object] = {
        "timestamp": 0,
        "pitch": forward,
        "roll": -left,
        "throttle": up,
        "yaw": -turn,
        "left_z": 0.0,
        "right_z": 0.0,
        "switches": 0,
        "vendor_id": "",
        "is_initialized": channels is not None,
        "is_valid": channels is not None,
    }
    return data, vehicle
