"""The gimbals of a UAV: their orders, and the roles that may send them. The manual is docs/how-to/gimbals.md.

None of it moves the UAV, so no lease is needed: one program may fly, and another one film.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace

from ual.errors import InvalidArgumentError, LinkLostError, NotSupportedError, WrongStateError
from ual.geometry import PointStamped, Vector3, stamped_point, wrap_angle
from ual.gimbals import (
    AngleRange,
    GimbalAbility,
    GimbalActivity,
    GimbalAngles,
    GimbalControl,
    GimbalInfo,
    GimbalReference,
    GimbalStatus,
)
from ual_daemon import validation
from ual_daemon.backends.chain import then, then_wait
from ual_daemon.backends.offers.gimbals import GimbalDriver, GimbalDrivers
from ual_daemon.flight.refusals import only_watching
from ual_daemon.services.answers import Pause, Steps
from ual_daemon.services.vehicle import GimbalVehicle, driver_of
from ual_daemon.vehicle.gimbals import GimbalTarget

LARGEST_ANGLE_RAD = 3.1415926535897932
LARGEST_YAW_RAD = 2.0 * LARGEST_ANGLE_RAD
LARGEST_TURN_RATE_RAD_S = 10.0
USUAL_RATE_HZ, LEAST_RATE_HZ, HIGHEST_RATE_HZ = 10.0, 0.1, 50.0
"""Rates in Hz at which a gimbal is watched."""
_ANGLE_TOLERANCE_RAD = 1e-4
"""Gimbals say their limits in single precision."""
_OF_REFERENCE = {
    GimbalReference.BODY: GimbalAbility.BODY,
    GimbalReference.HORIZON: GimbalAbility.HORIZON,
    GimbalReference.EARTH: GimbalAbility.EARTH,
}


class VehicleGimbals:
    """The gimbals of one UAV. From any thread; no method waits."""

    def __init__(self, vehicle: GimbalVehicle) -> None:
        self._vehicle = vehicle

    def get_all(self) -> list[GimbalInfo]:
        """See `ual.interface.Gimbals`."""
        found = self._offer().all()
        self._vehicle.gimbals.attach()
        frame_id = self._vehicle.gimbals.frame_id
        return [replace(each.info, frame_id=frame_id(each.info.number)) for each in found]

    def status(self, number: int) -> GimbalStatus:
        """See `ual.interface.Gimbal`."""
        return self._vehicle.gimbals.status(self._gimbal(number))

    def watch(self, number: int, rate_hz: float) -> Steps[GimbalStatus]:
        """See `ual.interface.Gimbal`."""
        pause = Pause(watch_interval_s(rate_hz))

        def statuses() -> Steps[GimbalStatus]:
            while True:
                yield self.status(number)
                yield pause

        return statuses()

    def set_angles(
        self,
        number: int,
        pitch_rad: float,
        yaw_rad: float,
        roll_rad: float,
        reference: GimbalReference,
        frame_id: str = "",
    ) -> Future[None]:
        """See `ual.interface.Gimbal`."""
        validation.require_type(reference, GimbalReference, "reference")
        angles = _angles(GimbalAngles(roll_rad, pitch_rad, yaw_rad))
        if frame_id and reference is not GimbalReference.EARTH:
            raise validation.refuse(
                "frame_id", f"only angles with the reference EARTH are in a frame, not {reference.name}"
            )
        gimbal = self._ordered(number, _OF_REFERENCE[reference], "turn the gimbal")
        _require_axes(gimbal.info, angles)
        if frame_id:
            in_odom = self._vehicle.transform(f"{self._vehicle.ns}/odom", validation.frame_id(frame_id, "frame_id"))
            angles = replace(angles, yaw_rad=wrap_angle(angles.yaw_rad + in_odom.rotation.yaw_rad))
        self._require_within(gimbal.info, angles, reference)
        return self._give(gimbal, GimbalActivity.ANGLES, lambda: gimbal.set_angles(angles, reference))

    def set_rates(self, number: int, pitch_rad_s: float, yaw_rad_s: float) -> Future[None]:
        """See `ual.interface.Gimbal`."""
        pitch_rad_s = validation.angle(pitch_rad_s, "pitch_rad_s", at_most=LARGEST_TURN_RATE_RAD_S)
        yaw_rad_s = validation.angle(yaw_rad_s, "yaw_rad_s", at_most=LARGEST_TURN_RATE_RAD_S)
        gimbal = self._ordered(number, GimbalAbility.RATES, "turn the gimbal")
        _require_axes(gimbal.info, GimbalAngles(0.0, pitch_rad_s, yaw_rad_s))
        return self._give(gimbal, GimbalActivity.RATES, lambda: gimbal.set_rates(pitch_rad_s, yaw_rad_s))

    def point_at(self, number: int, point: PointStamped | Vector3) -> Future[None]:
        """See `ual.interface.Gimbal`."""
        stamped = stamped_point(point)
        gimbal = self._ordered(number, GimbalAbility.HORIZON, "point the gimbal")
        goal = self._vehicle.gimbals.goal(number, stamped)
        aim = self._vehicle.gimbals.aim_now(gimbal, goal)  # what is refused is refused now, and not silently later

        def begin() -> Future[None]:
            return gimbal.set_angles(aim.angles, aim.reference)

        return self._give(gimbal, GimbalActivity.POINT, begin, GimbalTarget(stamped, goal))

    def move_to_neutral(self, number: int) -> Future[None]:
        """See `ual.interface.Gimbal`."""
        gimbal = self._ordered(number, GimbalAbility.NEUTRAL, "move the gimbal to neutral")
        return self._give(gimbal, GimbalActivity.NEUTRAL, gimbal.move_to_neutral)

    def retract(self, number: int) -> Future[None]:
        """See `ual.interface.Gimbal`."""
        gimbal = self._ordered(number, GimbalAbility.RETRACT, "retract the gimbal")
        return self._give(gimbal, GimbalActivity.RETRACTED, gimbal.retract)

    def take_control(self, number: int) -> Future[None]:
        """See `ual.interface.Gimbal`."""
        return self._able(number, GimbalAbility.CONTROL, "take the gimbal's control").take_control()

    def release_control(self, number: int) -> Future[None]:
        """See `ual.interface.Gimbal`."""
        gimbal = self._able(number, GimbalAbility.CONTROL, "release the gimbal's control")
        self._vehicle.gimbals.begin(number)
        return gimbal.release_control()

    def _give(
        self,
        gimbal: GimbalDriver,
        activity: GimbalActivity,
        order: Callable[[], Future[None]],
        followed: GimbalTarget | None = None,
    ) -> Future[None]:
        """Gives an order, after the control was taken where none has it. It ends the one before."""
        number, gimbals = gimbal.info.number, self._vehicle.gimbals
        begun = gimbals.begin(number)
        is_free = gimbal.control()[0] is GimbalControl.FREE and GimbalAbility.CONTROL in gimbal.info.abilities
        done = then_wait(gimbal.take_control(), lambda _: order()) if is_free else order()
        return then(done, lambda _: gimbals.did(number, begun, activity, followed))

    def _offer(self) -> GimbalDrivers:
        return driver_of(self._vehicle, GimbalDrivers, "gimbals")  # type: ignore[type-abstract]  # it is only looked for

    def _gimbal(self, number: int) -> GimbalDriver:
        gimbals = self._offer().all()
        validation.require_type(number, int, "gimbal")
        if not 0 <= number < len(gimbals):
            have = f"0 to {len(gimbals) - 1}" if gimbals else "none was found"
            raise InvalidArgumentError(f"gimbal: there is no gimbal {number}: {have}", {"field": "gimbal"})
        gimbal = gimbals[number]
        if not gimbal.info.is_connected:
            raise LinkLostError(f"gimbal {number} ({gimbal.info.name}) is not heard")
        return gimbal

    def _able(self, number: int, ability: GimbalAbility, command: str) -> GimbalDriver:
        gimbal = self._gimbal(number)
        info = gimbal.info
        if ability not in info.abilities:
            can = ", ".join(sorted(each.name.lower() for each in info.abilities)) or "nothing"
            text = f"gimbal {number} ({info.name}) does not offer {ability.name.lower()} (it offers: {can})"
            raise NotSupportedError(text, {"ability": ability.name.lower()})
        if self._vehicle.is_watch_only:
            raise only_watching(command)
        return gimbal

    def _ordered(self, number: int, ability: GimbalAbility, command: str) -> GimbalDriver:
        gimbal = self._able(number, ability, command)
        control, words = gimbal.control()
        if control is GimbalControl.OTHER:
            text = f"{command}: {words} has the control of gimbal {number}; take its control first"
            raise WrongStateError(text, {"controller": words, "needed": "control"})
        return gimbal

    def _require_within(self, info: GimbalInfo, angles: GimbalAngles, reference: GimbalReference) -> None:
        """Raises `InvalidArgumentError` for an angle that the gimbal cannot turn to as the UAV is turned now."""
        _require_angle(info, "pitch_rad", angles.pitch_rad, info.pitch)
        _require_angle(info, "roll_rad", angles.roll_rad, info.roll)
        if info.yaw is None:
            return
        yaw_rad = angles.yaw_rad
        if reference is GimbalReference.EARTH:
            yaw_rad = wrap_angle(yaw_rad - self._vehicle.gimbals.heading_rad())
        _require_angle(info, "yaw_rad", yaw_rad, info.yaw)


def watch_interval_s(rate_hz: float) -> float:
    """Returns the time between two statuses. 0: the usual rate. Raises `InvalidArgumentError` for another one."""
    rate_hz = validation.number(rate_hz, "rate_hz", at_most=HIGHEST_RATE_HZ) or USUAL_RATE_HZ
    if rate_hz < LEAST_RATE_HZ:
        raise validation.refuse("rate_hz", f"{rate_hz:g} is not from {LEAST_RATE_HZ:g} to {HIGHEST_RATE_HZ:g}")
    return 1.0 / rate_hz


def _angles(angles: GimbalAngles) -> GimbalAngles:
    return GimbalAngles(
        validation.angle(angles.roll_rad, "roll_rad", at_most=LARGEST_ANGLE_RAD),
        validation.angle(angles.pitch_rad, "pitch_rad", at_most=LARGEST_ANGLE_RAD),
        wrap_angle(validation.angle(angles.yaw_rad, "yaw_rad", at_most=LARGEST_YAW_RAD)),
    )


def _require_axes(info: GimbalInfo, angles: GimbalAngles) -> None:
    """Raises `NotSupportedError` for an angle, or a rate, of an axis that the gimbal lacks."""
    for ability, value in (
        (GimbalAbility.ROLL, angles.roll_rad),
        (GimbalAbility.PITCH, angles.pitch_rad),
        (GimbalAbility.YAW, angles.yaw_rad),
    ):
        if value and ability not in info.abilities:
            axis = ability.name.lower()
            raise NotSupportedError(f"gimbal {info.number} ({info.name}) has no {axis} axis", {"ability": axis})


def _require_angle(info: GimbalInfo, field: str, angle_rad: float, range_: AngleRange | None) -> None:
    if range_ is not None and abs(range_.nearest(angle_rad) - angle_rad) > _ANGLE_TOLERANCE_RAD:
        limits = f"{range_.least_rad:.3f} to {range_.most_rad:.3f} rad"
        hint = "; positive looks down" if field == "pitch_rad" else ""
        raise InvalidArgumentError(
            f"{field}: {angle_rad:.3f} is beyond the limits of gimbal {info.number} ({limits}{hint})",
            {"field": field, "least_rad": f"{range_.least_rad:.4f}", "most_rad": f"{range_.most_rad:.4f}"},
        )
