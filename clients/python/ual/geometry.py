"""Vectors, rotations, poses and transforms, and all their mathematics.

Axes follow REP 103: x forward, y left, z up in the body; x east, y north, z up outside. SI units and radians.
Quaternions are x, y, z, w (Hamilton convention, as in ROS); ``q.rotate(v)`` converts a vector from the rotated frame
(child) to the frame in which it is rotated (parent).
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, SupportsFloat, overload

from typing_extensions import override

from ual._wrong_type import require, wrong_type
from ual.errors import InvalidArgumentError
from ual.shared.quick import quick

if TYPE_CHECKING:
    from numpy.typing import DTypeLike, NDArray


class _Components:
    """The base of values that are a few numbers in an order."""

    __slots__ = ()
    __array_priority__ = 1.0
    """A number of numpy's times a vector is a vector: numpy leaves the product to the vector's own method."""

    @abstractmethod
    def __iter__(self) -> Iterator[float]:
        """Yields the numbers."""

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        """Makes an array of the numbers, for `numpy.asarray`."""
        import numpy as np  # imported late: a program without numpy never comes here

        if copy is False:
            raise ValueError(f"a {type(self).__name__} is no array: it is always copied into one")
        return np.array(tuple(self), float if dtype is None else dtype)


@dataclass(frozen=True, slots=True, init=False)
class Vector3(_Components):
    """Three components along x, y, z. The unit depends on what the vector is used for.

    ``np.asarray(vector)`` is an array of three, and ``Vector3(array)`` takes one.
    """

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    @overload
    def __init__(self, x: float = ..., y: float = ..., z: float = ...) -> None: ...
    @overload
    def __init__(self, x: Iterable[SupportsFloat]) -> None: ...
    def __init__(self, x: float | Iterable[SupportsFloat] = 0.0, y: float = 0.0, z: float = 0.0) -> None:
        # The usual classes come first: whether others are several numbers takes three calls.
        if type(x) is not float and type(x) is not int and isinstance(x, Iterable) and not isinstance(x, (str, bytes)):
            x, y, z = _numbers(x, (y, z), (0.0, 0.0), "three")
        _set_x(self, x)
        _set_y(self, y)
        _set_z(self, z)

    def __add__(self, other: Vector3) -> Vector3:
        return vector3(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: Vector3) -> Vector3:
        return vector3(self.x - other.x, self.y - other.y, self.z - other.z)

    def __neg__(self) -> Vector3:
        return vector3(-self.x, -self.y, -self.z)

    def __mul__(self, factor: float) -> Vector3:
        return Vector3(self.x * factor, self.y * factor, self.z * factor)  # an array is no factor

    __rmul__ = __mul__

    def __truediv__(self, divisor: float) -> Vector3:
        return Vector3(self.x / divisor, self.y / divisor, self.z / divisor)

    def __iter__(self) -> Iterator[float]:
        yield self.x
        yield self.y
        yield self.z

    def dot(self, other: Vector3) -> float:
        """Returns the scalar product."""
        return self.x * other.x + self.y * other.y + self.z * other.z

    def cross(self, other: Vector3) -> Vector3:
        """Returns the vector product."""
        return vector3(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )

    def norm(self) -> float:
        """Returns the length."""
        return math.hypot(self.x, self.y, self.z)

    def horizontal_norm(self) -> float:
        """Returns the length of the part along x and y."""
        return math.hypot(self.x, self.y)


_set_x, _set_y, _set_z = (vars(Vector3)[name].__set__ for name in ("x", "y", "z"))
"""Each update makes hundreds of vectors, and ``object.__setattr__`` takes half as long again."""


class _ThreeNumbers(_Components):
    """A `Vector3` before it is one: its numbers can be set."""

    __slots__ = ("x", "y", "z")
    x: float
    y: float
    z: float

    @override
    def __iter__(self) -> Iterator[float]:
        return iter((self.x, self.y, self.z))


_new = object.__new__


def vector3(x: float, y: float, z: float) -> Vector3:
    """Returns ``Vector3(x, y, z)`` of three numbers, in half of the instructions: for what makes many."""
    made: Any = _new(_ThreeNumbers)
    made.x, made.y, made.z = x, y, z
    made.__class__ = Vector3  # both have the same slots
    vector: Vector3 = made
    return vector


@dataclass(frozen=True, slots=True, init=False)
class Quaternion(_Components):
    """A rotation as a unit quaternion. `KEEP_HEADING` (all zeros) is not a rotation: it means "keep the heading".

    ``np.asarray(quaternion)`` is an array of four: x, y, z, w, and ``Quaternion(array)`` takes one.
    """

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    w: float = 1.0

    @overload
    def __init__(self, x: float = ..., y: float = ..., z: float = ..., w: float = ...) -> None: ...
    @overload
    def __init__(self, x: Iterable[SupportsFloat]) -> None: ...
    def __init__(
        self, x: float | Iterable[SupportsFloat] = 0.0, y: float = 0.0, z: float = 0.0, w: float = 1.0
    ) -> None:
        if type(x) is not float and type(x) is not int and isinstance(x, Iterable) and not isinstance(x, (str, bytes)):
            x, y, z, w = _numbers(x, (y, z, w), (0.0, 0.0, 1.0), "four")
        _set_qx(self, x)
        _set_qy(self, y)
        _set_qz(self, z)
        _set_qw(self, w)

    @classmethod
    def from_yaw(cls, yaw_rad: float) -> Quaternion:
        """Returns the rotation about z, counter-clockwise seen from above."""
        sine, cosine = _half(yaw_rad, "yaw_rad")
        return cls(0.0, 0.0, sine, cosine)

    @classmethod
    def from_euler(cls, roll_rad: float, pitch_rad: float, yaw_rad: float) -> Quaternion:
        """Returns the rotation by roll (x), then pitch (y), then yaw (z), each about a fixed axis (REP 103)."""
        sine_x, cosine_x = _half(roll_rad, "roll_rad")
        sine_y, cosine_y = _half(pitch_rad, "pitch_rad")
        return cls.from_yaw(yaw_rad) * cls(0.0, sine_y, 0.0, cosine_y) * cls(sine_x, 0.0, 0.0, cosine_x)

    def __mul__(self, other: Quaternion) -> Quaternion:
        """Returns the rotation that applies `other` first, then this one (Hamilton product)."""
        return Quaternion(
            self.w * other.x + self.x * other.w + self.y * other.z - self.z * other.y,
            self.w * other.y - self.x * other.z + self.y * other.w + self.z * other.x,
            self.w * other.z + self.x * other.y - self.y * other.x + self.z * other.w,
            self.w * other.w - self.x * other.x - self.y * other.y - self.z * other.z,
        )

    def __iter__(self) -> Iterator[float]:
        yield self.x
        yield self.y
        yield self.z
        yield self.w

    def norm(self) -> float:
        """Returns the length; 1 for a rotation."""
        return math.hypot(self.x, self.y, self.z, self.w)

    def normalized(self) -> Quaternion:
        """Returns the same rotation with unit length. Raises `ZeroDivisionError` for all zeros."""
        n = self.norm()
        return Quaternion(self.x / n, self.y / n, self.z / n, self.w / n)

    def inverse(self) -> Quaternion:
        """Returns the inverse rotation (of a unit quaternion)."""
        return Quaternion(-self.x, -self.y, -self.z, self.w)

    def rotate(self, v: Vector3) -> Vector3:
        """Returns the rotated vector (for a unit quaternion): v + 2 w (q x v) + 2 q x (q x v)."""
        # Written out in components, because frame transforms spend most of their time here.
        x, y, z, w = self.x, self.y, self.z, self.w
        tx, ty, tz = 2.0 * (y * v.z - z * v.y), 2.0 * (z * v.x - x * v.z), 2.0 * (x * v.y - y * v.x)
        return vector3(
            v.x + tx * w + (y * tz - z * ty), v.y + ty * w + (z * tx - x * tz), v.z + tz * w + (x * ty - y * tx)
        )

    @property
    def yaw_rad(self) -> float:
        """The heading: the angle of the rotated x axis about z, -pi to pi."""
        return math.atan2(
            2.0 * (self.w * self.z + self.x * self.y),
            self.w * self.w + self.x * self.x - self.y * self.y - self.z * self.z,
        )

    def to_euler(self) -> tuple[float, float, float]:
        """Returns roll, pitch and yaw in radians (see `from_euler`); pitch is within -pi/2 to pi/2."""
        sin_pitch = max(-1.0, min(1.0, 2.0 * (self.w * self.y - self.z * self.x)))
        roll = math.atan2(
            2.0 * (self.w * self.x + self.y * self.z),
            self.w * self.w - self.x * self.x - self.y * self.y + self.z * self.z,
        )
        return roll, math.asin(sin_pitch), self.yaw_rad


_set_qx, _set_qy, _set_qz, _set_qw = (vars(Quaternion)[name].__set__ for name in ("x", "y", "z", "w"))
IDENTITY = Quaternion()
KEEP_HEADING = Quaternion(0.0, 0.0, 0.0, 0.0)


def _half(angle_rad: float, name: str) -> tuple[float, float]:
    """Returns sine and cosine of half an angle."""
    try:
        return math.sin(angle_rad / 2), math.cos(angle_rad / 2)
    except (TypeError, ValueError):
        raise InvalidArgumentError(f"{name}: {angle_rad!r} is not an angle", {"field": name}) from None


_MOST_HEADING_RAD = math.tau + 1e-3
"""A full turn, also where it is written as 6.283 or 6.284."""


def heading(yaw_rad: float, field: str = "yaw_rad") -> float:
    """Returns a heading, unless it is more than a full turn: then it was hardly meant in radians.

    Raises:
        InvalidArgumentError: It is more than a full turn. The error names the `field`.

    """
    if isinstance(yaw_rad, (int, float)) and _MOST_HEADING_RAD < abs(yaw_rad) < math.inf:
        raise InvalidArgumentError(
            f"{field}: {yaw_rad:g} rad are more than a full turn: write math.radians({yaw_rad:g}) if these are "
            f"degrees, ual.geometry.wrap_angle({yaw_rad:g}) if they are radians",
            {"field": field},
        )
    return yaw_rad


def _numbers(
    components: Iterable[SupportsFloat], rest: tuple[float, ...], defaults: tuple[float, ...], count: str
) -> tuple[float, ...]:
    """Returns the components that came as an array, a list or another value, and so without the `rest` of them."""
    try:
        found = tuple(map(float, components))
        is_whole = len(found) == len(rest) + 1 and all(map(_is_left_out, rest, defaults))
    except (TypeError, ValueError):
        is_whole = False
    if not is_whole:
        raise InvalidArgumentError(f"{components!r} is neither a number nor {count} of them")
    return found


def _is_left_out(value: object, default: float) -> bool:
    return value.__class__ is float and value == default


def wrap_angle(angle_rad: float) -> float:
    """Returns the same direction within -pi to pi. Of a difference of headings this is the shortest turn."""
    return math.remainder(angle_rad, math.tau)


@quick
@dataclass(frozen=True, slots=True, repr=False)
class Pose:
    """Position (m) and orientation."""

    position: Vector3 = field(default_factory=Vector3)
    orientation: Quaternion = IDENTITY

    @classmethod
    def at(cls, x: float, y: float, z: float, yaw_rad: float | None = None) -> Pose:
        """Makes a goal: a position with a heading. If `yaw_rad` is None, the UAV keeps its heading.

        Raises:
            InvalidArgumentError: `yaw_rad` is more than a full turn, as an angle in degrees would be.

        """
        return cls(Vector3(x, y, z), KEEP_HEADING if yaw_rad is None else Quaternion.from_yaw(heading(yaw_rad)))

    @property
    def yaw_rad(self) -> float:
        """The heading, counter-clockwise from x."""
        return self.orientation.yaw_rad

    @override
    def __repr__(self) -> str:
        """The fields, and the heading, which no one reads from a quaternion."""
        heading = "kept" if self.orientation == KEEP_HEADING else f"{self.yaw_rad:.4g}"
        return f"Pose(position={self.position!r}, orientation={self.orientation!r}; yaw_rad: {heading})"


@quick
@dataclass(frozen=True, slots=True)
class Twist:
    """Linear (m/s) and angular (rad/s) velocity."""

    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)


@dataclass(frozen=True, slots=True)
class PoseStamped:
    """A pose in a frame (empty: ``<ns>/odom``); `stamp_s` is UTC since 1970, ignored in requests."""

    pose: Pose = field(default_factory=Pose)
    frame_id: str = ""
    stamp_s: float = 0.0


@dataclass(frozen=True, slots=True)
class PointStamped:
    """A position (m) in a frame (empty: ``<ns>/odom``); `stamp_s` as in `PoseStamped`."""

    point: Vector3 = field(default_factory=Vector3)
    frame_id: str = ""
    stamp_s: float = 0.0


@dataclass(frozen=True, slots=True)
class TwistStamped:
    """A velocity along the axes of a frame (empty: ``<ns>/odom``); `stamp_s` as in `PoseStamped`."""

    twist: Twist = field(default_factory=Twist)
    frame_id: str = ""
    stamp_s: float = 0.0


def stamped_pose(pose: PoseStamped | Pose, field: str = "pose") -> PoseStamped:
    """Returns the pose with its frame; one without a frame is in ``<ns>/odom``. Raises `InvalidArgumentError`, which
    names the field, unless it is a pose in all its parts.
    """
    stamped = PoseStamped(pose) if isinstance(pose, Pose) else pose
    require(stamped, PoseStamped, field)
    require(stamped.pose, Pose, f"{field}.pose")
    require(stamped.pose.position, Vector3, f"{field}.pose.position")
    require(stamped.pose.orientation, Quaternion, f"{field}.pose.orientation")
    return stamped


def stamped_point(point: PointStamped | Vector3, field: str = "point") -> PointStamped:
    """Returns the point with its frame; one without a frame is in ``<ns>/odom``. Raises as `stamped_pose`."""
    stamped = PointStamped(point) if isinstance(point, Vector3) else point
    require(stamped, PointStamped, field)
    require(stamped.point, Vector3, f"{field}.point")
    return stamped


def stamped_twist(velocity: TwistStamped | Twist, field: str = "velocity") -> TwistStamped:
    """Returns the velocity with its frame; one without a frame is in ``<ns>/odom``. Raises as `stamped_pose`."""
    stamped = TwistStamped(velocity) if isinstance(velocity, Twist) else velocity
    # Written out, because each setpoint takes this path: the usual case costs three checks of a type.
    if not isinstance(stamped, TwistStamped):
        raise wrong_type(velocity, Twist, field)
    twist = stamped.twist
    if not (isinstance(twist, Twist) and isinstance(twist.linear, Vector3) and isinstance(twist.angular, Vector3)):
        require(twist, Twist, f"{field}.twist")
        require(twist.linear, Vector3, f"{field}.twist.linear")
        require(twist.angular, Vector3, f"{field}.twist.angular")
    return stamped


@quick
@dataclass(frozen=True, slots=True)
class Transform:
    """Converts coordinates in the child frame to the parent `frame_id`: p = rotation * p_child + translation."""

    translation: Vector3 = field(default_factory=Vector3)
    rotation: Quaternion = IDENTITY
    frame_id: str = ""
    child_frame_id: str = ""
    stamp_s: float = 0.0

    def apply(self, point: Vector3) -> Vector3:
        """Converts a point from the child frame to the parent frame."""
        return self.rotation.rotate(point) + self.translation

    def apply_pose(self, pose: Pose) -> Pose:
        """Converts a pose from the child frame to the parent frame."""
        return Pose(self.apply(pose.position), self.rotation * pose.orientation)

    def compose(self, inner: Transform) -> Transform:
        """Returns the transform that applies `inner` first, then this one. The parent of `inner` must be the child of
        this one.
        """
        return Transform(
            self.apply(inner.translation),
            self.rotation * inner.rotation,
            self.frame_id,
            inner.child_frame_id,
            max(self.stamp_s, inner.stamp_s),
        )

    def inverse(self) -> Transform:
        """Returns the transform from the parent to the child."""
        back = self.rotation.inverse()
        return Transform(-back.rotate(self.translation), back, self.child_frame_id, self.frame_id, self.stamp_s)


def checked_transform(transform: Transform, field: str = "transform") -> Transform:
    """Returns the transform. Raises `InvalidArgumentError` as `stamped_pose`."""
    require(transform, Transform, field)
    require(transform.translation, Vector3, f"{field}.translation")
    require(transform.rotation, Quaternion, f"{field}.rotation")
    return transform
