"""Sends velocities, each for a short time: when no more come, `simple_flight` holds its position by itself."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import replace

from ual.geometry import Vector3
from ual_daemon.backends.airsim.rpc import RpcConnection
from ual_daemon.backends.airsim.settings import AirsimAddress
from ual_daemon.backends.airsim.state import AirsimReport
from ual_daemon.backends.values import PositionSetpoint, Setpoint, VelocitySetpoint

VELOCITY_S = 0.5
"""Simulated seconds for which a velocity is flown, unless a newer one comes."""
_MOST_UNANSWERED_CALLS = 1
"""A call lasts until the next one replaces it, which waits for that. Of two that wait, the simulator forgets to end the
first one at once; and each call holds one of its few threads: it has four more than vehicles. While its time stands
still, no call ends."""
_STUCK_CALL_NS = 2_000_000_000
"""Simulated nanoseconds without an answer after which a velocity gets none: all of them were over after 0.5 s."""
_ANY_HEADING = 0
"""DrivetrainType.MaxDegreeOfFreedom."""


_LEAD, _MOST_LEAD_M_S = 1.0, 3.0
"""Lead of the sent horizontal velocity: a factor of the velocity error, and its limit in m/s. `simple_flight` follows a
velocity in 1.0 s by itself, and so in 0.5 s.
"""
_CLIMB_LEAD, _MOST_CLIMB_LEAD_M_S = 1.2, 2.0
"""Vertically it follows in 0.3 s by itself, but rises by 0.6 m when it levels out after it has accelerated."""


def led(setpoint: VelocitySetpoint, measured: Vector3) -> VelocitySetpoint:
    """Returns the velocity to send so that the vehicle soon flies the one that is wanted."""
    missing = setpoint.velocity - measured
    lead = min(_LEAD, _MOST_LEAD_M_S / max(missing.horizontal_norm(), 1e-9))
    up = min(max(missing.z * _CLIMB_LEAD, -_MOST_CLIMB_LEAD_M_S), _MOST_CLIMB_LEAD_M_S)
    wanted = setpoint.velocity + Vector3(missing.x * lead, missing.y * lead, up)
    return replace(setpoint, velocity=wanted)


def move_arguments(setpoint: VelocitySetpoint, vehicle: str, duration_s: float = VELOCITY_S) -> tuple[object, ...]:
    """Returns the arguments of ``moveByVelocity``: north, east, down, and degrees clockwise a second.

    A call of no duration waits until the one that is flown has ended, and flies nothing.
    """
    velocity = setpoint.velocity
    yaw = {"is_rate": True, "yaw_or_rate": -math.degrees(setpoint.yaw_rate_rad_s)}
    return velocity.y, velocity.x, -velocity.z, duration_s, _ANY_HEADING, yaw, vehicle


class AirsimSetpointSender:
    """Sends setpoints on a connection of its own, from one thread: that of the mailbox."""

    def __init__(
        self, address: AirsimAddress, vehicle: Callable[[], str], newest: Callable[[], AirsimReport | None]
    ) -> None:
        """`newest` returns what the simulator reported last; None while the link is down."""
        self._address = address
        self._vehicle = vehicle
        self._newest = newest
        self._lock = threading.Lock()
        self._connection: RpcConnection | None = None
        self._sent_at: int | None = None
        self._is_closed = False

    def send(self, setpoint: Setpoint) -> None:
        """Sends it, if the simulator's time has advanced since the last one, and the vehicle takes commands.

        Raises:
            OSError: The connection is lost; the next setpoint makes a new one.
        """
        assert not isinstance(setpoint, PositionSetpoint)  # VehicleInfo.takes
        report = self._newest()
        if report is None or not report.has_api_control or report.state.timestamp == self._sent_at:
            return
        try:
            connection = self._connected()
            connection.drain()
            if connection.unwanted_count <= _MOST_UNANSWERED_CALLS:
                connection.post(
                    "moveByVelocity", *move_arguments(led(setpoint, report.velocity.linear), self._vehicle())
                )
                self._sent_at = report.state.timestamp
            elif self._sent_at is not None and report.state.timestamp - self._sent_at > _STUCK_CALL_NS:
                raise ConnectionResetError("the simulator ends no velocity any more: connecting anew")
        except (OSError, ValueError):
            self.disconnect()
            raise

    def close(self) -> None:
        """Closes the connection for good."""
        self._is_closed = True
        self.disconnect()

    def _connected(self) -> RpcConnection:
        with self._lock:
            if self._connection is None:
                if self._is_closed:
                    raise ConnectionAbortedError("the backend is closed")
                self._connection = RpcConnection(self._address)
            return self._connection

    def disconnect(self) -> None:
        """Closes the connection, and drops what has not reached the simulator. The next use makes a new one."""
        with self._lock:
            connection, self._connection = self._connection, None
        if connection is not None:
            connection.abort()
