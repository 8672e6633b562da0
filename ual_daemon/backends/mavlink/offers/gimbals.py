"""The gimbals of a MAVLink vehicle: what any thread orders goes to the thread that receives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future

from typing_extensions import override

from ual.errors import UalError
from ual.geometry import Vector3
from ual.gimbals import GimbalAngles, GimbalControl, GimbalInfo, GimbalReference
from ual_daemon.backends.mavlink.offers.protocol_access import ProtocolAccess
from ual_daemon.backends.mavlink.protocols.gimbal_link import GimbalLink
from ual_daemon.backends.offers.gimbals import GimbalAttitude, GimbalDriver, GimbalDrivers


class MavlinkGimbal(GimbalDriver):
    """One gimbal.

    Args:
        link: The gimbal on the thread that receives.
        now_s: The backend's clock.
        reach: The way to the thread that receives.

    """

    def __init__(self, link: GimbalLink, now_s: Callable[[], float], access: ProtocolAccess) -> None:
        self._link = link
        self._now_s = now_s
        self._access = access

    @property
    @override
    def info(self) -> GimbalInfo:
        return self._link.info(self._now_s())

    @property
    @override
    def mount_position(self) -> Vector3:
        return Vector3()  # the protocol does not tell it

    @override
    def attitude(self) -> GimbalAttitude | None:
        return self._link.attitude_at(self._now_s())

    @override
    def control(self) -> tuple[GimbalControl | None, str]:
        return self._link.control

    @override
    def problems(self) -> Sequence[str]:
        return self._link.failures

    @override
    def set_angles(self, angles: GimbalAngles, reference: GimbalReference) -> Future[None]:
        return self._run_on_loop("turn its gimbal", lambda future: self._link.turn(angles, reference, future))

    @override
    def set_rates(self, pitch_rad_s: float, yaw_rad_s: float) -> Future[None]:
        return self._run_on_loop(
            "turn its gimbal", lambda future: self._link.turn_at_rates(pitch_rad_s, yaw_rad_s, future)
        )

    @override
    def aim(self, angles: GimbalAngles, reference: GimbalReference) -> None:
        if not isinstance(self._access.session_in_reach("aim its gimbal"), UalError):
            self._link.aim(angles, reference)

    @override
    def move_to_neutral(self) -> Future[None]:
        return self._run_on_loop("turn its gimbal", lambda future: self._link.rest(future, is_retracted=False))

    @override
    def retract(self) -> Future[None]:
        return self._run_on_loop("retract its gimbal", lambda future: self._link.rest(future, is_retracted=True))

    @override
    def take_control(self) -> Future[None]:
        return self._run_on_loop("take its gimbal's control", self._link.take)

    @override
    def release_control(self) -> Future[None]:
        return self._run_on_loop("release its gimbal's control", self._link.release)

    def _run_on_loop(self, what: str, begin: Callable[[Future[None]], None]) -> Future[None]:
        return self._access.run_on_loop(what, lambda _, future: begin(future))


class MavlinkGimbals(GimbalDrivers):
    """The gimbals of one backend; see `MavlinkGimbal`. `found` returns those that were found."""

    def __init__(
        self, found: Callable[[], Sequence[GimbalLink]], now_s: Callable[[], float], access: ProtocolAccess
    ) -> None:
        self._found = found
        self._now_s = now_s
        self._access = access

    @override
    def all(self) -> Sequence[GimbalDriver]:
        return [MavlinkGimbal(link, self._now_s, self._access) for link in self._found()]
