"""Reports of the simulator in its own terms: north, east, down, and its names on the wire."""

from __future__ import annotations

import math

import msgspec

from ual.geometry import Pose, Quaternion, Twist, Vector3

_STANDARD_GRAVITY_M_S2 = 9.80665
_STILL_M_S, _STILL_M_S2 = 0.05, 1.0
_SUPPORTED_THRUST_SHARE = 0.8
"""The part of its weight below which the thrust of a vehicle that stands still shows that something carries it."""
_TURNING_RAD_S = 1.0
"""An armed rotor turns at 173 rad/s at least, a disarmed one stands."""
_LANDED_STATE = 0


class Vector(msgspec.Struct, frozen=True):
    """A vector: north, east, down, or forward, right, down."""

    x_val: float = 0.0
    y_val: float = 0.0
    z_val: float = 0.0

    def to_enu(self) -> Vector3:
        """Converts north, east, down to east, north, up."""
        return Vector3(self.y_val, self.x_val, -self.z_val)

    def to_flu(self) -> Vector3:
        """Converts forward, right, down to forward, left, up."""
        return Vector3(self.x_val, -self.y_val, -self.z_val)

    def norm(self) -> float:
        """Returns the length."""
        return math.sqrt(self.x_val**2 + self.y_val**2 + self.z_val**2)


class Rotation(msgspec.Struct, frozen=True):
    """The rotation from forward, right, down to north, east, down."""

    w_val: float
    x_val: float
    y_val: float
    z_val: float

    def to_enu(self) -> Quaternion:
        """Returns the rotation from forward, left, up to east, north, up. All zeros, which are no rotation, stay so."""
        w, x, y, z, half = self.w_val, self.x_val, self.y_val, self.z_val, math.sqrt(0.5)
        rotation = Quaternion(half * (x + y), half * (x - y), half * (w - z), half * (w + z))
        return rotation.normalized() if any(rotation) else rotation


class Kinematics(msgspec.Struct, frozen=True):
    """Motion of the vehicle: linear along its local axes, the rotation about its body's."""

    position: Vector
    orientation: Rotation
    linear_velocity: Vector
    angular_velocity: Vector
    linear_acceleration: Vector


class Collision(msgspec.Struct, frozen=True):
    """The answer to ``simGetCollisionInfo``: the last collision. `time_stamp` is 0 if there was none."""

    time_stamp: int = 0
    normal: Vector = Vector()
    object_name: str = ""


class Location(msgspec.Struct, frozen=True):
    """A place on Earth."""

    latitude: float
    longitude: float
    altitude: float


class RemoteControl(msgspec.Struct, frozen=True):
    """State of the remote control."""

    is_valid: bool


class MultirotorState(msgspec.Struct, frozen=True):
    """The answer to ``getMultirotorState``. Its ``collision`` is always empty."""

    kinematics_estimated: Kinematics
    timestamp: int
    landed_state: int
    rc_data: RemoteControl


class Rotor(msgspec.Struct, frozen=True):
    """One rotor: its thrust in newtons, and its speed in rad/s."""

    thrust: float
    speed: float


class Rotors(msgspec.Struct, frozen=True):
    """The answer to ``getRotorStates``."""

    rotors: list[Rotor]


class AirsimReport(msgspec.Struct, frozen=True):
    """Values of one poll. `collision` may be of an earlier poll."""

    state: MultirotorState
    rotors: Rotors
    has_api_control: bool
    collision: Collision

    @property
    def time_s(self) -> float:
        """The simulator's time."""
        return self.state.timestamp * 1e-9

    @property
    def is_armed(self) -> bool:
        """Whether the motors run: the simulator has no other sign of it."""
        return any(abs(rotor.speed) > _TURNING_RAD_S for rotor in self.rotors.rotors)

    @property
    def is_flying(self) -> bool:
        """Whether ``landed_state`` reports flight: see `is_on_ground`."""
        return self.state.landed_state != _LANDED_STATE

    @property
    def pose(self) -> Pose:
        """The pose in the local frame, which begins where the vehicle was placed."""
        motion = self.state.kinematics_estimated
        return Pose(motion.position.to_enu(), motion.orientation.to_enu())

    @property
    def velocity(self) -> Twist:
        """The velocity: linear along the local axes, angular in the body."""
        motion = self.state.kinematics_estimated
        return Twist(motion.linear_velocity.to_enu(), motion.angular_velocity.to_flu())

    def is_on_ground(self, mass_kg: float) -> bool:
        """Returns whether it stands on something.

        ``landed_state`` says "flying" from the first lift-off until the vehicle is disarmed, and "landed" at once where
        it is disarmed in the air. So the forces tell: what stands still with less thrust than its weight is carried.
        """
        motion = self.state.kinematics_estimated
        if not (motion.linear_velocity.norm() <= _STILL_M_S and motion.linear_acceleration.norm() <= _STILL_M_S2):
            return False  # NaN, too
        thrust_n = sum(rotor.thrust for rotor in self.rotors.rotors)
        return not self.is_flying or thrust_n < _SUPPORTED_THRUST_SHARE * mass_kg * _STANDARD_GRAVITY_M_S2
