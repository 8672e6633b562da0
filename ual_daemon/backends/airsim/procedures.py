"""The commands as calls of the simulator. Each is executed on the thread of `AirsimCommandQueue`."""

from __future__ import annotations

import math
from collections.abc import Callable

from ual.geometry import Vector3
from ual_daemon.backends.airsim.commands import RefusedError
from ual_daemon.backends.airsim.rpc import RpcCaller
from ual_daemon.backends.airsim.setpoints import move_arguments
from ual_daemon.backends.values import VelocitySetpoint

_ANSWER_S = 2.0
_STILL = VelocitySetpoint(Vector3())


def _vector(north: float, east: float, down: float) -> dict[str, float]:
    return {"x_val": north, "y_val": east, "z_val": down}


_STANDING = {
    name: _vector(0.0, 0.0, 0.0)
    for name in ("linear_velocity", "angular_velocity", "linear_acceleration", "angular_acceleration")
}


class Procedures:
    """The commands to one vehicle."""

    def __init__(self, vehicle: Callable[[], str]) -> None:
        self._vehicle = vehicle

    def arm(self, connection: RpcCaller) -> None:
        """Arms; the API must have control for that."""
        self._require_api_control(connection)
        self.start_motors(connection)

    def disarm(self, connection: RpcCaller) -> None:
        """Disarms. The simulator does it in the air, too: the caller refuses that."""
        self._require_api_control(connection)
        self.stop_motors(connection)

    def hover(self, connection: RpcCaller) -> None:
        """Stops the vehicle, which then hovers by itself."""
        connection.post("moveByVelocity", *move_arguments(_STILL, self._vehicle()))

    def take_control(self, connection: RpcCaller) -> None:
        """Gives the API control, and hovers.

        A vehicle that gets API control in the air falls until a command comes, also if it had it already.
        """
        if self._require_api_control(connection):
            self.hover(connection)

    def put_on_ground(self, connection: RpcCaller, position: Vector3, yaw_rad: float) -> None:
        """Puts the vehicle somewhere, at rest, and disarms it."""
        self._require_api_control(connection)
        self.stop_motors(connection)
        half = (math.pi / 2.0 - yaw_rad) / 2.0
        pose = {
            "position": _vector(position.y, position.x, -position.z),
            "orientation": {"w_val": math.cos(half), "x_val": 0.0, "y_val": 0.0, "z_val": math.sin(half)},
        }
        still = {**_STANDING, **pose}
        connection.call(object, _ANSWER_S, "simSetKinematics", still, True, self._vehicle())

    def set_wind(self, connection: RpcCaller, wind: Vector3) -> None:
        """Sets the wind of the whole simulator."""
        connection.call(object, _ANSWER_S, "simSetWind", _vector(wind.y, wind.x, -wind.z))

    def pause(self, connection: RpcCaller, stands_still: bool) -> None:
        """Pauses the simulator, or lets it run on."""
        connection.call(object, _ANSWER_S, "simPause", stands_still)

    def is_paused(self, connection: RpcCaller) -> bool:
        """Returns whether the simulator is paused."""
        return connection.call(bool, _ANSWER_S, "simIsPaused")

    def step(self, connection: RpcCaller, duration_s: float) -> None:
        """Lets a paused simulator run on for a while. Returns when it has."""
        connection.call(object, _ANSWER_S + 20.0 * duration_s, "simContinueForTime", duration_s)

    def _require_api_control(self, connection: RpcCaller) -> bool:
        """Gives the API control unless it has it. Returns whether it had none.

        Raises:
            RefusedError: The simulator's settings or the switch of a remote control do not allow it.
        """
        if connection.call(bool, _ANSWER_S, "isApiControlEnabled", self._vehicle()):
            return False
        self.enable(connection)
        return True

    def enable(self, connection: RpcCaller) -> None:
        """Gives the API the control, at once.

        Raises:
            RefusedError: The simulator's settings or the switch of a remote control do not allow it.
        """
        vehicle = self._vehicle()
        connection.call(object, _ANSWER_S, "enableApiControl", True, vehicle)
        if not connection.call(bool, _ANSWER_S, "isApiControlEnabled", vehicle):
            raise RefusedError("API control is not allowed: see AllowAPIAlways in the simulator's settings.json")

    def start_motors(self, connection: RpcCaller) -> None:
        """Arms."""
        self._arm_or_disarm(connection, True)

    def require_own_control(self, connection: RpcCaller) -> None:
        """Checks that the API has control, and leaves it as it is.

        Raises:
            RefusedError: The safety pilot has it.
        """
        if not connection.call(bool, _ANSWER_S, "isApiControlEnabled", self._vehicle()):
            raise RefusedError("the safety pilot has the control (API control is off)")

    def stop_motors(self, connection: RpcCaller) -> None:
        """Disarms a vehicle on the ground.

        A velocity that is still flown would start the motors again, and could then not be disarmed. So it is ended
        first, and the vehicle armed, which makes a second attempt possible.
        """
        connection.call(bool, _ANSWER_S, "moveByVelocity", *move_arguments(_STILL, self._vehicle(), 0.0))
        self._arm_or_disarm(connection, True)
        self._arm_or_disarm(connection, False)

    def _arm_or_disarm(self, connection: RpcCaller, arms: bool) -> None:
        if not connection.call(bool, _ANSWER_S, "armDisarm", arms, self._vehicle()):
            raise RefusedError("armDisarm returned False")
