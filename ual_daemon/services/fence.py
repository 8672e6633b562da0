"""The autopilot's fence and rally points: what may be uploaded, and when. The manual is docs/how-to/fence.md."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import replace as altered
from functools import partial
from typing import Any, Protocol

from typing_extensions import override

from ual import interface
from ual.errors import GeofenceError, RejectedByAutopilotError, UalError, WrongStateError
from ual.fences.values import FencePlan, FenceZone, KeptFence, RallyPoint, crossing, leaves_out
from ual.parameters.values import Parameter
from ual.types import AltitudeReference, Telemetry
from ual_daemon import logs, validation
from ual_daemon.backends.chain import caught, done, in_turn, then, then_wait
from ual_daemon.backends.offers.fence import AutopilotFenceStore, FenceSwitch
from ual_daemon.backends.offers.parameters import AutopilotParameters, Refusal
from ual_daemon.services.answers import answer, in_thread
from ual_daemon.services.vehicle import (
    LoadedVehicle,
    driver_of,
    require_change,
    require_disarmed,
)
from ual_daemon.vehicle.upload_journal import FENCE, RALLY, Upload

MOST_CORNERS = 255
"""As ArduPilot has it (MissionItemProtocol_Fence)."""
MOST_ITEMS = 500
_LARGEST_RADIUS_M = 1e6
_HIGHEST_POINT_M = 32767
"""ArduPilot keeps the height of a rally point in 16 bits."""
_UPLOAD, _CLEAR, _SWITCH = "upload a fence", "clear the fence", "enable or disable the fence"
_DISARM = "disarm first"
_FORCE = f"{_DISARM}, or force it if you know what it does in flight"

_log = logging.getLogger(__name__)


class FencedVehicle(LoadedVehicle, Protocol):
    """A UAV that may have a geofence of its own, and says where it is."""

    def telemetry(self) -> Telemetry:
        """The newest sample of everything known."""

    def configured_fence(self) -> tuple[tuple[float, float], ...]:
        """The corners of the polygon of UAL's own geofence; see `ual_daemon.vehicle.on_earth.fence_on_earth`."""


class VehicleFence:
    """The fence of the autopilot of one UAV. From any thread; no method waits."""

    def __init__(self, vehicle: FencedVehicle) -> None:
        self._vehicle = vehicle

    def get(self) -> Future[KeptFence]:
        """See `ual.interface.Fence`."""
        store = self._store()

        def with_zones(zones: tuple[FenceZone, ...]) -> Future[KeptFence]:
            return then_wait(store.read_rally(), partial(with_rally, zones))

        def with_rally(zones: tuple[FenceZone, ...], rally_points: tuple[RallyPoint, ...]) -> Future[KeptFence]:
            point = store.return_point
            return then(self._is_enabled(), lambda is_on: KeptFence(zones, rally_points, is_on, point))

        return then_wait(store.read(), with_zones)

    @in_thread  # it writes a file
    def upload(
        self, plan: FencePlan | None, lease_id: str, *, replace: bool, enable: bool, force: bool
    ) -> Future[KeptFence]:
        """See `ual.interface.Fence`."""
        store = self._store()
        plan = FencePlan((self._configured(),)) if plan is None else _checked(plan)
        refusal = self._refusal(_UPLOAD, lease_id, force=force, zones=plan.zones)
        clear = self._refusal(_CLEAR, lease_id, force=force)
        begin = self._vehicle.uploads.begin
        zones = begin(FENCE, len(plan.zones)) if plan.zones else None
        rally = begin(RALLY, len(plan.rally_points)) if plan.rally_points else None
        changing = partial(
            in_turn,
            lambda: self._begin(refusal),
            # What is there is read in any case: `write` keeps its point to return to.
            lambda: (
                caught(store.read(), _no_fence) if replace else then(self.get(), lambda kept: _require_free(kept, plan))
            ),
            lambda: self._change(zones, store.write, plan.zones, refusal, clear if store.keeps_parts else None),
            lambda: self._change(
                rally, store.write_rally, plan.rally_points, refusal, clear if store.keeps_parts_of_rally else None
            ),
            lambda: self._switch(refusal, is_on=True) if enable and plan.zones else done(None),
            lambda: then(self.get(), partial(_logged, "fence_uploaded")),
        )
        return _dropping(changing, zones, rally)

    @in_thread  # it writes a file
    def clear(self, lease_id: str, *, with_rally_points: bool, force: bool) -> Future[KeptFence]:
        """See `ual.interface.Fence`."""
        store = self._store()
        refusal = self._refusal(_CLEAR, lease_id, force=force)
        zones = self._vehicle.uploads.begin(FENCE, 0)
        rally = self._vehicle.uploads.begin(RALLY, 0) if with_rally_points else None
        changing = partial(
            in_turn,
            lambda: self._begin(refusal),
            lambda: self._change(zones, store.write, (), refusal),
            lambda: self._change(rally, store.write_rally, (), refusal),
            lambda: then(self.get(), partial(_logged, "fence_cleared")),
        )
        return _dropping(changing, zones, rally)

    def enable(self, lease_id: str) -> Future[KeptFence]:
        """See `ual.interface.Fence`."""
        self._store()
        self._vehicle.uploads.require_whole("enable the fence", FENCE, RALLY)
        return self._enabled(lease_id, is_on=True)

    def disable(self, lease_id: str) -> Future[KeptFence]:
        """See `ual.interface.Fence`."""
        self._store()
        return self._enabled(lease_id, is_on=False)

    def _enabled(self, lease_id: str, *, is_on: bool) -> Future[KeptFence]:
        refusal = self._refusal(_SWITCH, lease_id, force=False)
        return in_turn(
            lambda: self._begin(refusal),
            lambda: self._switch(refusal, is_on=is_on),
            lambda: then(self.get(), partial(_logged, "fence_switched")),
        )

    def _change(
        self,
        upload: Upload | None,
        write: Callable[[Sequence[Any], Refusal], Future[Any]],
        items: Sequence[FenceZone] | Sequence[RallyPoint],
        refusal: Refusal,
        clear: Refusal | None = None,
    ) -> Future[Any]:
        """Writes a list; nothing where there is no upload. With `clear`, what is cut off is removed again."""
        if upload is None:
            return done(None)
        name = upload.list

        def undo() -> Future[Any]:
            assert clear is not None
            return self._change(self._vehicle.uploads.begin(name, 0), write, (), clear)

        return upload.run(partial(write, items), refusal, None if clear is None else undo)

    def _begin(self, refusal: Refusal) -> Future[None]:
        error = refusal()
        if error is not None:
            raise error
        return done(None)

    def _refusal(self, command: str, lease_id: str, *, force: bool, zones: Sequence[FenceZone] = ()) -> Refusal:
        """Returns what says why nothing may be changed now."""
        vehicle = self._vehicle

        def refusal() -> UalError | None:
            try:
                require_change(vehicle, command, lease_id)
                if not force:
                    require_disarmed(vehicle, command, _DISARM if command == _SWITCH else _FORCE)
                self._require_inside(zones)
            except UalError as error:
                return error
            return None

        return refusal

    def _require_inside(self, zones: Sequence[FenceZone]) -> None:
        if not zones:
            return
        here = self._vehicle.telemetry().position_geo
        if here is None:
            raise WrongStateError(f"{_UPLOAD}: it is not known where on Earth the UAV is")
        is_any = self._store().unites_inclusions
        why = leaves_out(zones, here.latitude_deg, here.longitude_deg, unites_inclusions=is_any)
        if why:
            text = f"{_UPLOAD}: the fence does not contain the UAV: {why}; the autopilot would act at once"
            raise GeofenceError(text, {"zone": why})

    def _configured(self) -> FenceZone:
        corners = self._vehicle.configured_fence()
        if not corners:
            text = f"{_UPLOAD}: the geofence of UAL's own configuration has no polygon; give a file"
            raise WrongStateError(text, {"needed": "geofence.polygon"})
        return FenceZone(is_inclusion=True, points=corners)

    def _is_enabled(self) -> Future[bool | None]:
        """Returns whether all parameters have the zones applied; None where there are none."""
        parameters, switches = self._parameters(), self._store().switches
        found: list[bool] = []

        def read(switch: FenceSwitch) -> Future[None]:
            return then(parameters.read(switch.name), lambda read: found.append(switch.is_on(read.value)))

        return then(
            in_turn(lambda: done(None), *(partial(read, each) for each in switches)),
            lambda _: all(found) if found else None,
        )

    def _switch(self, refusal: Refusal, *, is_on: bool) -> Future[None]:
        parameters = self._parameters()

        def write(switch: FenceSwitch, before: Parameter) -> Future[Parameter]:
            value = switch.switched(before.value, is_on=is_on)
            return done(before) if value == before.value else parameters.write(altered(before, value=value), refusal)

        def switched(switch: FenceSwitch) -> Future[Parameter]:
            return then_wait(parameters.read(switch.name), partial(write, switch))

        return in_turn(lambda: done(None), *(partial(switched, each) for each in self._store().switches))

    def _store(self) -> AutopilotFenceStore:
        return driver_of(self._vehicle, AutopilotFenceStore, "fences")  # type: ignore[type-abstract]  # it is only looked for

    def _parameters(self) -> AutopilotParameters:
        return driver_of(self._vehicle, AutopilotParameters, "parameters")  # type: ignore[type-abstract]  # as above


class FenceBase(interface.Fence):
    """Members without a method of their own: one method switches the fence on and off."""

    _of_vehicle: VehicleFence
    _lease_id: Callable[[], str]

    @override
    def disable(self) -> KeptFence:
        return answer(self._of_vehicle.disable(self._lease_id()), "EnableFence")


def _dropping(change: Callable[[], Future[KeptFence]], *uploads: Upload | None) -> Future[KeptFence]:
    """Begins a change. Drops the uploads that were not run, once all has ended."""

    def drop(_: object = None) -> None:
        for each in uploads:
            if each is not None:
                each.drop()

    try:
        changing = change()
    except BaseException:
        drop()
        raise
    changing.add_done_callback(drop)
    return changing


def _no_fence(error: BaseException) -> Future[tuple[FenceZone, ...]]:
    """Returns no zones where the autopilot's content is no fence: that may be replaced."""
    if isinstance(error, RejectedByAutopilotError):
        return done(())
    raise error


def _require_free(kept: KeptFence, plan: FencePlan) -> None:
    """Refuses where the autopilot has other zones, or other rally points, than those that are to be uploaded."""
    zones = () if not plan.zones or _is_same(kept.zones, plan.zones) else kept.zones
    points = () if not plan.rally_points or kept.rally_points == plan.rally_points else kept.rally_points
    if zones or points:
        there = [each.text for each in zones] + ([f"{len(points)} rally points"] if points else [])
        text = f"{_UPLOAD}: the autopilot has another one: {', '.join(there)}; replace it, if that is meant"
        raise WrongStateError(text, {"needed": "replace", "zones": str(len(zones)), "rally_points": str(len(points))})


def _is_same(kept: Sequence[FenceZone], wanted: Sequence[FenceZone]) -> bool:
    """Returns whether zones are alike, as finely as an autopilot keeps them."""
    return [_rounded(each) for each in kept] == [_rounded(each) for each in wanted]


def _rounded(zone: FenceZone) -> tuple[object, ...]:
    points = [(round(latitude_deg, 7), round(longitude_deg, 7)) for latitude_deg, longitude_deg in zone.points]
    return zone.is_inclusion, points, None if zone.radius_m is None else round(zone.radius_m, 3)


def _checked(plan: FencePlan) -> FencePlan:
    """Raises `InvalidArgumentError` for what no autopilot can keep."""
    validation.require_type(plan, FencePlan, "plan")
    if not plan.zones and not plan.rally_points:
        raise validation.refuse("plan", "it has no zones and no rally points; to remove them, clear the fence")
    if sum(len(each.points) for each in plan.zones) + len(plan.rally_points) > MOST_ITEMS:
        raise validation.refuse("plan", f"it has more than {MOST_ITEMS} corners, circles and rally points")
    for number, zone in enumerate(plan.zones):
        _check_zone(zone, f"zones[{number}]")
    for number, point in enumerate(plan.rally_points):
        _check_rally(point, f"rally_points[{number}]")
    return plan


def _check_zone(zone: FenceZone, field: str) -> None:
    if zone.radius_m is None and not 3 <= len(zone.points) <= MOST_CORNERS:
        raise validation.refuse(field, f"a polygon has from 3 to {MOST_CORNERS} corners, not {len(zone.points)}")
    if zone.radius_m is not None:
        validation.positive(zone.radius_m, f"{field}.radius_m", at_most=_LARGEST_RADIUS_M)
        if len(zone.points) != 1:
            raise validation.refuse(field, f"a circle has one centre, not {len(zone.points)}")
    for corner in zone.points:
        _check_position(*corner, field)
    crossed = crossing(zone.points) if zone.radius_m is None else None
    if crossed:
        text = "a polygon whose sides {} and {} cross or touch has no clear inside: autopilots differ about it"
        raise validation.refuse(field, text.format(*crossed))


def _check_rally(point: RallyPoint, field: str) -> None:
    _check_position(point.latitude_deg, point.longitude_deg, field)
    if point.reference not in (AltitudeReference.HOME, AltitudeReference.AMSL):
        raise validation.refuse(field, "its height is above home or above mean sea level")
    height_m = validation.number(point.height_m, f"{field}.height_m", at_most=_HIGHEST_POINT_M)
    if not height_m.is_integer():
        raise validation.refuse(field, f"its height is whole metres, as ArduPilot keeps it, not {height_m:g}")


def _check_position(latitude_deg: float, longitude_deg: float, field: str) -> None:
    validation.number(latitude_deg, f"{field} latitude", at_most=90.0)
    validation.number(longitude_deg, f"{field} longitude", at_most=180.0)


def _logged(event: str, kept: KeptFence) -> KeptFence:
    zones, points = len(kept.zones), len(kept.rally_points)
    logs.event(_log, logging.INFO, event, zones=zones, rally_points=points, enabled=kept.is_enabled)
    return kept
