"""Allowed writes of parameters, and the end of waiting, with a backend and a UAV that are made up."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from concurrent.futures import CancelledError, Future
from typing import Any, TypeVar

import pytest

from tests.ual_daemon.services.limits import limit
from ual.errors import (
    InvalidArgumentError,
    LeaseHeldError,
    LinkLostError,
    NotSupportedError,
    PermissionDeniedError,
    UalError,
    UalTimeoutError,
    WrongStateError,
)
from ual.parameters import Description, Parameter, ParameterType
from ual.types import State
from ual_daemon.backends.offers.parameters import AutopilotParameters, Refusal
from ual_daemon.server.services.waiting import ended
from ual_daemon.services._derived import Parameters
from ual_daemon.services.parameters import VehicleParameters
from ual_daemon.services.vehicle import wait

T = TypeVar("T")

GAIN, LIMIT = "GAIN", "LIMIT"
INT8, REAL32 = ParameterType.INT8, ParameterType.REAL32


class Offer(AutopilotParameters):
    """Answers when a test says so."""

    relied_on = frozenset({LIMIT})

    def __init__(self) -> None:
        self.reading: Future[Parameter] = Future()
        self.listing: Future[list[Parameter]] = Future()
        self.writing: Future[Parameter] = Future()
        self.written: list[Parameter] = []
        self.refusal: Refusal = lambda: None

    def read(self, name: str) -> Future[Parameter]:
        return self.reading

    def read_all(self) -> Future[list[Parameter]]:
        return self.listing

    def write(self, parameter: Parameter, refusal: Refusal) -> Future[Parameter]:
        self.written.append(parameter)
        self.refusal = refusal
        return self.writing


class Vehicle:
    """One that is on the ground, and whose lease has the identifier ``mine``."""

    ns, backend_name = "uav_1", "made_up"

    def __init__(self, offer: Offer | None) -> None:
        self._offer = offer
        self.is_watch_only = False
        self.armed: bool | None = False

    def state(self) -> State:
        return State.LANDED_ARMED if self.armed else State.LANDED_DISARMED

    def offer(self, kind: type[T]) -> T | None:
        return self._offer if isinstance(self._offer, kind) else None

    def is_armed(self) -> bool | None:
        return self.armed

    def require_lease(self, command: str, lease_id: str) -> None:
        if lease_id != "mine":
            raise LeaseHeldError(f"{command}: another program holds the lease")


@pytest.fixture
def offer() -> Offer:
    return Offer()


@pytest.fixture
def vehicle(offer: Offer) -> Vehicle:
    return Vehicle(offer)


def set_(vehicle: Vehicle, name: str = GAIN, value: Any = 1.0, *, force: bool = False) -> Future[Parameter]:
    return VehicleParameters(vehicle).set(name, value, "mine", force=force)


def test_the_type_that_was_read_is_the_one_that_is_written(vehicle: Vehicle, offer: Offer) -> None:
    future = set_(vehicle, value=3.0)
    assert offer.written == []
    offer.reading.set_result(Parameter(GAIN, 1, INT8))
    assert offer.written == [Parameter(GAIN, 3, INT8)]
    offer.writing.set_result(Parameter(GAIN, 3, INT8))
    assert future.result(0) == Parameter(GAIN, 3, INT8)


@pytest.mark.parametrize("value", [0.5, 128.0, -129.0])
def test_a_value_that_the_type_lacks_is_not_written(vehicle: Vehicle, offer: Offer, value: float) -> None:
    future = set_(vehicle, value=value)
    offer.reading.set_result(Parameter(GAIN, 1, INT8))
    assert isinstance(future.exception(0), InvalidArgumentError)
    assert offer.written == []


@pytest.mark.parametrize("value", [float("nan"), float("inf"), "5", None, 10**400])
def test_what_is_no_number_is_not_even_read(vehicle: Vehicle, value: object) -> None:
    with pytest.raises(InvalidArgumentError, match=r"^value: "):
        set_(vehicle, value=value)


@pytest.mark.parametrize("name", ["", "A B", "Ä", "N" * 65, 5])
def test_what_is_no_name_is_refused(vehicle: Vehicle, name: Any) -> None:
    with pytest.raises(InvalidArgumentError, match=r"^name: "):
        VehicleParameters(vehicle).get(name)


@pytest.mark.parametrize(
    ("name", "armed", "force", "is_written"),
    [
        (GAIN, False, False, True),
        (LIMIT, False, False, True),
        (GAIN, True, False, False),
        (GAIN, None, False, False),
        (GAIN, True, True, True),
        (GAIN, None, True, True),
        (LIMIT, True, True, False),
        (LIMIT, None, True, False),
    ],
)
def test_what_may_be_written_and_when(
    vehicle: Vehicle, offer: Offer, name: str, armed: bool | None, force: bool, is_written: bool
) -> None:
    vehicle.armed = armed
    offer.reading.set_result(Parameter(name, 0.5, REAL32))
    if is_written:
        set_(vehicle, name, force=force)
        assert len(offer.written) == 1
        assert offer.refusal() is None
    else:
        with pytest.raises(LinkLostError if armed is None else WrongStateError) as refused:
            set_(vehicle, name, force=force)
        assert refused.value.metadata["needed"] == "LANDED_DISARMED"
        assert offer.written == []


def test_one_that_is_armed_meanwhile_is_refused_to_the_backend(vehicle: Vehicle, offer: Offer) -> None:
    set_(vehicle)
    vehicle.armed = True
    offer.reading.set_result(Parameter(GAIN, 0.5, REAL32))
    assert isinstance(offer.refusal(), WrongStateError)


def test_a_lease_and_a_daemon_that_watches_keep_from_writing(vehicle: Vehicle) -> None:
    with pytest.raises(LeaseHeldError):
        VehicleParameters(vehicle).set(GAIN, 1.0, "other", force=False)
    vehicle.is_watch_only = True
    with pytest.raises(PermissionDeniedError):
        set_(vehicle)


def test_what_is_not_available_is_not_supported() -> None:
    with pytest.raises(NotSupportedError, match="the backend made_up of uav_1 does not offer them"):
        VehicleParameters(Vehicle(None)).get(GAIN)


def test_who_gives_up_withdraws_what_was_begun(vehicle: Vehicle, offer: Offer) -> None:
    future = set_(vehicle)
    future.cancel()
    assert offer.reading.cancelled()
    assert offer.written == []


def test_who_gives_up_later_withdraws_the_write(vehicle: Vehicle, offer: Offer) -> None:
    future = set_(vehicle)
    offer.reading.set_result(Parameter(GAIN, 0.5, REAL32))
    future.cancel()
    assert offer.writing.cancelled()
    with pytest.raises(CancelledError):
        future.result(0)


def test_what_the_backend_withdraws_is_not_waited_for(vehicle: Vehicle, offer: Offer) -> None:
    future = set_(vehicle)
    offer.reading.set_result(Parameter(GAIN, 0.5, REAL32))
    offer.writing.cancel()
    assert future.cancelled()
    offer.listing.cancel()
    with pytest.raises(UalError, match="ListParameters was withdrawn"):
        Parameters(vehicle, lambda: "mine").get_all()
    with pytest.raises(UalError, match="ListParameters was withdrawn"):
        asyncio.run(ended(offer.listing, 1.0, "ListParameters"))


def test_waiting_ends_also_where_the_backend_never_answers(
    vehicle: Vehicle, offer: Offer, monkeypatch: pytest.MonkeyPatch
) -> None:
    limit(monkeypatch, "GetParameter", 0.0)
    with pytest.raises(UalTimeoutError, match="GetParameter did not end within 0 s"):
        Parameters(vehicle, lambda: "mine").get(GAIN)
    assert offer.reading.cancelled()
    with pytest.raises(UalTimeoutError, match="GetParameter did not end within 0 s"):
        asyncio.run(ended(Future(), 0.0, "GetParameter"))


def test_a_time_out_of_the_backend_keeps_its_words() -> None:
    def late() -> Future[None]:
        future: Future[None] = Future()
        future.set_exception(UalTimeoutError("GAIN was not answered"))
        return future

    with pytest.raises(UalTimeoutError, match="GAIN was not answered"):
        wait(late(), 1.0, "reading")
    with pytest.raises(UalTimeoutError, match="GAIN was not answered"):
        asyncio.run(ended(late(), 1.0, "reading"))


# --- What the autopilot tells about them ------------------------------------------------------------------------------

ABOUT = Description(0.0, 10.0, "m/s", "a gain", needs_reboot=True)


class DescribingOffer(Offer):
    """Tells about GAIN."""

    def descriptions(self) -> Future[Mapping[str, Description]]:
        future: Future[Mapping[str, Description]] = Future()
        future.set_result({GAIN: ABOUT})
        return future


def test_what_the_autopilot_tells_stands_next_to_the_value() -> None:
    offer = DescribingOffer()
    parameters = VehicleParameters(Vehicle(offer))
    offer.reading.set_result(Parameter(GAIN, 1.0, REAL32))
    offer.listing.set_result([Parameter(LIMIT, 2.0, REAL32), Parameter(GAIN, 1.0, REAL32)])
    described = Parameter(GAIN, 1.0, REAL32, False, 0.0, 10.0, "m/s", "a gain", True)
    assert parameters.get(GAIN).result(0) == described
    assert parameters.get_all().result(0) == [Parameter(LIMIT, 2.0, REAL32, is_relied_on=True), described]


@pytest.mark.parametrize(
    ("before", "value", "force", "is_written"),
    [
        (1.0, 10.0, False, True),
        (1.0, 0.0, False, True),
        (1.0, 10.5, False, False),
        (1.0, -0.5, False, False),
        (1.0, 10.5, True, True),
        (50.0, 50.0, False, True),  # as it is
    ],
)
def test_a_value_out_of_its_range_is_written_only_by_force(
    before: float, value: float, force: bool, is_written: bool
) -> None:
    offer = DescribingOffer()
    future = VehicleParameters(Vehicle(offer)).set(GAIN, value, "mine", force=force)
    offer.reading.set_result(Parameter(GAIN, before, REAL32))
    assert bool(offer.written) is is_written
    if not is_written:
        error = future.exception(0)
        assert isinstance(error, InvalidArgumentError)
        assert "GAIN has 0 to 10 m/s (force writes it all the same)" in error.message
