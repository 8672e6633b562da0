"""Allowed uploads of a fence, with a backend and a UAV that are made up."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import replace
from typing import Any, TypeVar

import pytest

from tests.ual_daemon.services import test_parameters as of_parameters
from ual.errors import (
    GeofenceError,
    InvalidArgumentError,
    LeaseHeldError,
    LinkLostError,
    NotSupportedError,
    PermissionDeniedError,
    RejectedByAutopilotError,
    UalError,
    WrongStateError,
)
from ual.fences import FencePlan, FenceZone, KeptFence, RallyPoint
from ual.parameters import Parameter, ParameterType
from ual.types import AltitudeReference, GeoPoint, Telemetry
from ual_daemon.backends.chain import done
from ual_daemon.backends.offers.fence import AutopilotFenceStore, FenceSwitch
from ual_daemon.backends.offers.parameters import AutopilotParameters, Refusal
from ual_daemon.services._derived import Fence
from ual_daemon.services.fence import VehicleFence
from ual_daemon.vehicle.upload_journal import UploadJournal

T = TypeVar("T")

FIELD = FenceZone(True, ((47.0, 8.0), (47.002, 8.0), (47.002, 8.002), (47.0, 8.002)))
POND = FenceZone(False, ((47.001, 8.001),), 20.0)
PLAN = FencePlan((FIELD, POND))
RALLY = RallyPoint(47.001, 8.0005, 20)
HERE = GeoPoint(47.0005, 8.0005)


class Store(AutopilotFenceStore, AutopilotParameters):
    """An autopilot that does as it is told, but for what a test changes."""

    switches = (FenceSwitch("TYPE", 4, is_bit=True), FenceSwitch("ENABLE", 1))
    unites_inclusions = False
    relied_on = frozenset({"ENABLE"})

    def __init__(self) -> None:
        self.zones: tuple[FenceZone, ...] = ()
        self.points: tuple[RallyPoint, ...] = ()
        self.values = {"TYPE": 3, "ENABLE": 0}
        self.sent: list[str] = []
        self.before_sending: Callable[[], None] = lambda: None

    def read(self, name: str = "") -> Future[Any]:
        return done(self._parameter(name) if name else self.zones)

    def read_rally(self) -> Future[tuple[RallyPoint, ...]]:
        return done(self.points)

    def write(self, wanted: Any, refusal: Refusal) -> Future[Any]:
        if isinstance(wanted, Parameter):
            return self._changed(f"{wanted.name}={wanted.value}", refusal, lambda: self._set(wanted))
        return self._changed("zones", refusal, lambda: setattr(self, "zones", tuple(wanted)))

    def write_rally(self, points: Sequence[RallyPoint], refusal: Refusal) -> Future[tuple[RallyPoint, ...]]:
        return self._changed("rally points", refusal, lambda: setattr(self, "points", tuple(points)))

    def read_all(self) -> Future[list[Parameter]]:
        raise NotImplementedError

    def _changed(self, what: str, refusal: Refusal, change: Callable[[], None]) -> Future[Any]:
        self.before_sending()
        future: Future[Any] = Future()
        error = refusal()
        if error is not None:
            future.set_exception(error)
        else:
            self.sent.append(what)
            change()
            future.set_result(None)
        return future

    def _set(self, wanted: Parameter) -> None:
        self.values[wanted.name] = int(wanted.value)

    def _parameter(self, name: str) -> Parameter:
        return Parameter(name, self.values[name], ParameterType.INT8)


class Vehicle(of_parameters.Vehicle):
    """One that stands in the field."""

    def __init__(self, store: Store | None) -> None:
        super().__init__(None)
        self._store = store
        self.place: GeoPoint | None = HERE
        self.corners: tuple[tuple[float, float], ...] = FIELD.points
        self.uploads = UploadJournal(None, lambda: "")

    def telemetry(self) -> Telemetry:
        return Telemetry(self.state(), position_geo=self.place)

    def configured_fence(self) -> tuple[tuple[float, float], ...]:
        return self.corners

    def offer(self, kind: type[T]) -> T | None:
        return self._store if isinstance(self._store, kind) else None


@pytest.fixture
def store() -> Store:
    return Store()


@pytest.fixture
def vehicle(store: Store) -> Vehicle:
    return Vehicle(store)


def upload(vehicle: Vehicle, plan: FencePlan | None = PLAN, **how: bool) -> Future[KeptFence]:
    flags = {"replace": False, "enable": True, "force": False, **how}
    return VehicleFence(vehicle).upload(plan, "mine", **flags)


def refusal_of(begin: Callable[[], Future[Any]]) -> UalError:
    try:
        error = begin().exception(0)
    except UalError as raised:
        error = raised
    assert isinstance(error, UalError)
    return error


def test_a_fence_is_uploaded_and_then_enabled_and_reported_as_it_is_kept(vehicle: Vehicle, store: Store) -> None:
    kept = upload(vehicle).result(0)
    assert kept == KeptFence((FIELD, POND), (), is_enabled=True)
    assert store.sent == ["zones", "TYPE=7", "ENABLE=1"]


def test_without_a_plan_it_is_the_polygon_of_the_configuration(vehicle: Vehicle) -> None:
    assert upload(vehicle, None).result(0).zones == (FIELD,)
    vehicle.corners = ()
    assert "has no polygon" in refusal_of(lambda: upload(vehicle, None)).message


def test_it_may_be_left_as_it_is_whether_it_is_enabled(vehicle: Vehicle, store: Store) -> None:
    assert upload(vehicle, enable=False).result(0).is_enabled is False
    assert store.sent == ["zones"]


def test_rally_points_stay_where_none_are_passed(vehicle: Vehicle, store: Store) -> None:
    store.points = (RALLY,)
    assert upload(vehicle).result(0).rally_points == (RALLY,)
    only_rally = FencePlan((), (RallyPoint(47.0, 8.0, 1),))
    assert upload(vehicle, only_rally, replace=True).result(0).rally_points == only_rally.rally_points
    assert store.zones == PLAN.zones


def test_another_fence_is_shown_and_only_replaced_where_that_is_meant(vehicle: Vehicle, store: Store) -> None:
    store.zones, store.points = (POND,), (RALLY,)
    error = refusal_of(lambda: upload(vehicle, FencePlan((FIELD,), (RallyPoint(47.0, 8.0, 1),))))
    assert isinstance(error, WrongStateError)
    assert "exclusion circle of 20 m, 1 rally points" in error.message
    assert error.metadata == {"needed": "replace", "zones": "1", "rally_points": "1"}
    assert store.sent == []
    assert upload(vehicle, replace=True).result(0).zones == PLAN.zones


def test_the_same_fence_need_not_be_replaced(vehicle: Vehicle, store: Store) -> None:
    latitude, longitude = FIELD.points[0]
    store.zones = (replace(FIELD, points=((latitude + 2e-9, longitude), *FIELD.points[1:])), POND)
    assert upload(vehicle).result(0).is_enabled


@pytest.mark.parametrize("armed", [True, None])
def test_nothing_is_changed_while_it_may_be_armed_unless_forced(
    vehicle: Vehicle, store: Store, armed: bool | None
) -> None:
    vehicle.armed = armed
    fence = VehicleFence(vehicle)
    for begin in (
        lambda: upload(vehicle),
        lambda: fence.clear("mine", with_rally_points=True, force=False),
        lambda: fence.enable("mine"),
    ):
        assert type(refusal_of(begin)) is (LinkLostError if armed is None else WrongStateError)
    assert store.sent == []
    switching = str(refusal_of(lambda: fence.disable("mine")))
    assert switching.endswith("it must be disarmed" if armed is None else "disarm first"), "there is no force for it"
    assert upload(vehicle, force=True).result(0).zones == PLAN.zones


def test_what_changes_en_route_stops_it(vehicle: Vehicle, store: Store) -> None:
    def arm() -> None:
        vehicle.armed = "zones" in store.sent

    store.before_sending = arm
    assert isinstance(refusal_of(lambda: upload(vehicle)), WrongStateError)
    assert store.sent == ["zones"]  # and it was not enabled


def test_a_fence_that_does_not_contain_the_uav_is_refused(vehicle: Vehicle, store: Store) -> None:
    vehicle.place = GeoPoint(47.001, 8.001)
    error = refusal_of(lambda: upload(vehicle, force=True))
    assert isinstance(error, GeofenceError)
    assert "inside the exclusion circle of 20 m" in error.message
    vehicle.place = None
    assert "where on Earth" in refusal_of(lambda: upload(vehicle)).message
    assert store.sent == []
    assert upload(vehicle, FencePlan((), (RALLY,))).result(0).rally_points == (RALLY,)


def test_a_lease_of_another_and_a_daemon_that_watches_keep_it_from_changing(vehicle: Vehicle) -> None:
    fence = VehicleFence(vehicle)
    assert isinstance(refusal_of(lambda: fence.enable("other")), LeaseHeldError)
    vehicle.is_watch_only = True
    assert isinstance(refusal_of(lambda: upload(vehicle)), PermissionDeniedError)
    assert fence.get().result(0) == KeptFence((), (), is_enabled=False)


def test_clearing_leaves_rally_points_unless_requested_to(vehicle: Vehicle, store: Store) -> None:
    store.zones, store.points = PLAN.zones, (RALLY,)
    fence = VehicleFence(vehicle)
    assert fence.clear("mine", with_rally_points=False, force=False).result(0) == KeptFence((), (RALLY,), False)
    assert fence.clear("mine", with_rally_points=True, force=False).result(0).rally_points == ()


def test_enabling_and_disabling_write_what_is_not_so_yet(vehicle: Vehicle, store: Store) -> None:
    fence = Fence(vehicle, lambda: "mine")
    assert fence.enable().is_enabled
    assert store.sent == ["TYPE=7", "ENABLE=1"]
    assert fence.enable().is_enabled
    assert len(store.sent) == 2
    assert not fence.disable().is_enabled
    assert store.sent[2:] == ["ENABLE=0"]  # the kinds of fences stay


@pytest.mark.parametrize(
    ("value", "is_on", "then_on", "then_off"), [(0, False, 2, 0), (1, False, 2, 1), (2, True, 2, 0), (3, True, 3, 0)]
)
def test_px4_applies_its_zones_where_it_does_more_than_warn(
    value: float, is_on: bool, then_on: float, then_off: float
) -> None:
    switch = FenceSwitch("GF_ACTION", 2, least=2)
    assert switch.is_on(value) is is_on
    assert (switch.switched(value, is_on=True), switch.switched(value, is_on=False)) == (then_on, then_off)


@pytest.mark.parametrize(
    "plan",
    [
        FencePlan(()),
        FencePlan((FenceZone(True, ((47.0, 8.0), (47.1, 8.0))),)),
        FencePlan((FenceZone(True, ((47.0, 8.0), (47.002, 8.002), (47.0, 8.002), (47.002, 8.0))),)),  # a bow tie
        FencePlan((FenceZone(True, ((47.0, 8.0),) * 256),)),
        FencePlan((FenceZone(True, ((47.0, 8.0),), 0.0),)),
        FencePlan((FenceZone(True, ((47.0, 8.0),), float("nan")),)),
        FencePlan((FenceZone(True, ((47.0, 8.0), (47.1, 8.0)), 5.0),)),
        FencePlan((FenceZone(True, ((91.0, 8.0),), 5.0),)),
        FencePlan((FenceZone(True, ((47.0, float("inf")),), 5.0),)),
        FencePlan((POND,) * 501),
        FencePlan((), (replace(RALLY, height_m=40000),)),
        FencePlan((), (RallyPoint(47.0, 8.0, 0.5),)),  # type: ignore[arg-type]  # as a program may
        FencePlan((), (replace(RALLY, reference=AltitudeReference.ELLIPSOID),)),
        "field.plan",
    ],
)
def test_what_no_autopilot_can_keep_is_not_sent(vehicle: Vehicle, store: Store, plan: Any) -> None:
    assert isinstance(refusal_of(lambda: upload(vehicle, plan)), InvalidArgumentError)
    assert store.sent == []


def test_what_the_autopilot_refuses_comes_back(vehicle: Vehicle, store: Store) -> None:
    def refuse() -> None:
        raise RejectedByAutopilotError("fence, item 1: the autopilot answers NO_SPACE")

    store.before_sending = refuse
    assert isinstance(refusal_of(lambda: upload(vehicle)), RejectedByAutopilotError)


def test_a_backend_without_it_says_so() -> None:
    fence = Fence(Vehicle(None), lambda: "mine")
    for act in (fence.get, fence.upload, fence.clear, fence.enable, fence.disable):
        with pytest.raises(NotSupportedError, match="fences: the backend made_up of uav_1 does not offer them"):
            act()
