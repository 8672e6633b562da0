"""Interface of a backend's gimbals; see `ual_daemon.services.gimbals`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from concurrent.futures import Future
from typing import NamedTuple

from typing_extensions import override

from ual.geometry import Pose, Quaternion, Vector3
from ual.gimbals import GimbalAngles, GimbalControl, GimbalInfo, GimbalReference


class GimbalAttitude(NamedTuple):
    """Attitude of a gimbal.

    Attributes:
        orientation: x along its view, y left, z up.
        reference: In which axes that is: those of the body, level ones that turn with the nose, or those of the
            backend's local frame.
        time_s: When, by the backend's clock.
    """

    orientation: Quaternion
    reference: GimbalReference
    time_s: float

    def in_local(self, body: Pose | None) -> Quaternion | None:
        """Returns it in the axes of the local frame; None where the pose of the body is needed, and not known."""
        if self.reference is GimbalReference.EARTH:
            return self.orientation
        if body is None:
            return None
        if self.reference is GimbalReference.BODY:
            return body.orientation * self.orientation
        return Quaternion.from_yaw(body.yaw_rad) * self.orientation

    def in_body(self, body: Pose | None) -> Quaternion | None:
        """Returns it in the axes of the body; None where the pose of that is needed, and not known."""
        if self.reference is GimbalReference.BODY:
            return self.orientation
        in_local = self.in_local(body)
        return None if body is None or in_local is None else body.orientation.inverse() * in_local


class GimbalDriver(ABC):
    """One gimbal. From any thread; no method waits.

    Each future ends by itself, also where nothing answers: with a `LinkLostError`, or with a `UalTimeoutError`. What
    the gimbal refuses ends it with a `RejectedByAutopilotError`. A method is called only if `info` has its ability.
    Angles with the reference EARTH count from the x axis of the backend's local frame.
    """

    @property
    @abstractmethod
    def info(self) -> GimbalInfo:
        """Identity and abilities of the gimbal, as far as it has reported them. The `frame_id` is set above."""

    @property
    @abstractmethod
    def mount_position(self) -> Vector3:
        """Position in the body; zeros where that is not known."""

    @abstractmethod
    def attitude(self) -> GimbalAttitude | None:
        """Returns its present attitude; None where it has not reported one lately."""

    @abstractmethod
    def control(self) -> tuple[GimbalControl | None, str]:
        """Returns the program on the link that has the control of it: None where it does not say. In words, where one
        has it.
        """

    @abstractmethod
    def problems(self) -> Sequence[str]:
        """Returns its problems, human-readable."""

    @abstractmethod
    def set_angles(self, angles: GimbalAngles, reference: GimbalReference) -> Future[None]:
        """Turns to angles. The future ends once that was accepted."""

    @abstractmethod
    def set_rates(self, pitch_rad_s: float, yaw_rad_s: float) -> Future[None]:
        """Turns at rates until the next order."""

    @abstractmethod
    def aim(self, angles: GimbalAngles, reference: GimbalReference) -> None:
        """As `set_angles`, for angles that are sent often: nothing answers, and a lost one is not sent again."""

    @abstractmethod
    def move_to_neutral(self) -> Future[None]:
        """Turns to its neutral angles."""

    @abstractmethod
    def retract(self) -> Future[None]:
        """Retracts it."""

    @abstractmethod
    def take_control(self) -> Future[None]:
        """Takes the control of it, from whatever program has it."""

    @abstractmethod
    def release_control(self) -> Future[None]:
        """Gives the control up."""


class GimbalDrivers(ABC):
    """The gimbals of one UAV. From any thread."""

    @abstractmethod
    def all(self) -> Sequence[GimbalDriver]:
        """All that were found: each has its number as its place. None is ever removed."""


class FindableGimbal(GimbalDriver):
    """A gimbal of which it shows later whether there is one."""

    @property
    @abstractmethod
    def is_found(self) -> bool:
        """Whether there is one, as far as was received. Once it is, it stays."""


class OneGimbal(GimbalDrivers):
    """The gimbals of a UAV that has one at most: none until it is found."""

    def __init__(self, gimbal: FindableGimbal) -> None:
        self._gimbal = gimbal

    @override
    def all(self) -> Sequence[GimbalDriver]:
        return [self._gimbal] if self._gimbal.is_found else []
