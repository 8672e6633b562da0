"""The commands as calls of the simulator. Each is executed on the thread of `CommandQueue`."""

from __future__ import annotations

from collections.abc import Callable

from ual.geometry import Vector3
from ual_daemon.backends.airsim.commands import RefusedError
from ual_daemon.backends.airsim.rpc import Connection
from ual_daemon.backends.airsim.setpoints import move_arguments
from ual_daemon.backends.values import VelocitySetpoint

_ANSWER_S = 2.0
_STILL = VelocitySetpoint(Vector3())


class Procedures:
    """The commands to one vehicle."""

    def __init__(self, vehicle: Callable[[], str]) -> None:
        self._vehicle = vehicle

    def arm(self, connection: Connection) -> None:
        """Arms; the API must have control for that."""
        self._require_api_control(connection)
        self._arm_or_disarm(connection, True)

    def disarm(self, connection: Connection) -> None:
        """Disarms. The simulator does it in the air, too: the caller refuses that.

        A velocity that is still flown would start the motors again, and could then not be disarmed. So it is ended
        first, and the vehicle armed, which makes a second attempt possible.
        """
        self._require_api_control(connection)
        connection.call(bool, _ANSWER_S, "moveByVelocity", *move_arguments(_STILL, self._vehicle(), 0.0))
        self._arm_or_disarm(connection, True)
        self._arm_or_disarm(connection, False)

    def take_control(self, connection: Connection) -> None:
        """Gives the API control, and hovers.

        A vehicle that gets API control in the air falls until a command comes, also if it had it already.
        """
        if self._require_api_control(connection):
            connection.post("moveByVelocity", *move_arguments(_STILL, self._vehicle()))

    def _require_api_control(self, connection: Connection) -> bool:
        """Gives the API control unless it has it. Returns whether it had none.

        Raises:
            RefusedError: The simulator's settings or the switch of a remote control do not allow it.
        """
        vehicle = self._vehicle()
        if connection.call(bool, _ANSWER_S, "isApiControlEnabled", vehicle):
            return False
        connection.call(object, _ANSWER_S, "enableApiControl", True, vehicle)
        if not connection.call(bool, _ANSWER_S, "isApiControlEnabled", vehicle):
            raise RefusedError("API control is not allowed: see AllowAPIAlways in the simulator's settings.json")
        return True

    def _arm_or_disarm(self, connection: Connection, arms: bool) -> None:
        if not connection.call(bool, _ANSWER_S, "armDisarm", arms, self._vehicle()):
            raise RefusedError("armDisarm returned False")
