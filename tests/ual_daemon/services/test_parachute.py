"""The parachute of a UAV: that of a light one, of an ArduPilot, and a component beside either autopilot."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future

import pytest

from tests.simulators.parachute import Parachute
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight
from ual.errors import (
    LeaseHeldError,
    LinkLostError,
    NotSupportedError,
    RejectedByAutopilotError,
    UalTimeoutError,
    WrongStateError,
)
from ual.types import State
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.light.backend import LightBackend
from ual_daemon.backends.light.parachute import LightParachute
from ual_daemon.backends.offers.parachute import ParachuteAction, ParachuteDriver
from ual_daemon.services.parachute import VehicleParachute

DISABLE, ENABLE, RELEASE = ParachuteAction
BY_AUTOPILOT = "ardupilot"


@pytest.fixture
def start() -> Iterator[Callable[[str], Flight]]:
    """Starts the flight of a simulated autopilot."""
    flights: list[Flight] = []

    def started(kind: str) -> Flight:
        flights.append(Flight(kind))
        flights[-1].wait_for_state(State.LANDED_DISARMED)
        return flights[-1]

    yield started
    for each in flights:
        each.uav.close()


@pytest.mark.parametrize("kind", [BY_AUTOPILOT, "px4"])
def test_a_component_obeys_and_refuses_in_its_own_words(start: Callable[[str], Flight], kind: str) -> None:
    flight = start(kind)
    carried = Parachute(flight.autopilot, is_component=True)
    flight.let_pass(1.5)
    parachute = flight.uav.parachute
    with pytest.raises(RejectedByAutopilotError, match="DENIED"):
        parachute.release()
    carried.failures = 2  # so it is sent again
    parachute.enable()
    parachute.release()
    parachute.disable()
    assert carried.orders == [RELEASE, ENABLE, RELEASE, DISABLE]
    assert parachute.ordered() == "disable"


def test_a_release_that_an_ardupilot_acknowledges_and_does_not_do_is_refused_by_its_text(
    start: Callable[[str], Flight],
) -> None:
    """A real one below CHUTE_ALT_MIN: it was accepted, and counted as released."""
    flight = start(BY_AUTOPILOT)
    carried, parachute = Parachute(flight.autopilot, is_component=False), flight.uav.parachute
    parachute.enable()
    with pytest.raises(RejectedByAutopilotError, match="Parachute: Landed"):
        parachute.release()
    flight.take_off()
    carried.least_height_m = 30.0
    with pytest.raises(RejectedByAutopilotError, match="Parachute: Too low"):
        parachute.release()
    assert parachute.ordered() == "enable"
    parachute.disable()
    with pytest.raises(UalTimeoutError, match="it may be disabled"):
        parachute.release()
    assert flight.uav.state() is State.FLYING_AUTO


def test_a_release_by_an_ardupilot_ends_once_it_is_reported_and_is_not_repeated(start: Callable[[str], Flight]) -> None:
    flight = start(BY_AUTOPILOT)
    carried, parachute = Parachute(flight.autopilot, is_component=False), flight.uav.parachute
    parachute.enable()
    flight.take_off()
    carried.failures = 2  # so it is sent again
    parachute.release()
    assert parachute.ordered() == "release"
    flight.wait_for(lambda: "disarmed in the air" in flight.uav.telemetry().state_reason, "what came of it")
    assert carried.orders == [ENABLE, RELEASE]


@pytest.mark.parametrize(("kind", "why"), [("px4", "no component 161 is heard"), (BY_AUTOPILOT, "UNSUPPORTED")])
def test_without_one_an_order_is_not_supported(start: Callable[[str], Flight], kind: str, why: str) -> None:
    with pytest.raises(NotSupportedError, match=why):
        start(kind).uav.parachute.release()


def test_a_light_one_opens_only_while_it_is_enabled() -> None:
    is_link_lost = False
    parachute = LightParachute(lambda: is_link_lost)
    assert isinstance(parachute.order(RELEASE).exception(0), RejectedByAutopilotError)
    assert parachute.order(ENABLE).result(0) is None
    assert not parachute.is_released
    is_link_lost = True
    assert isinstance(parachute.order(RELEASE).exception(0), LinkLostError)
    is_link_lost = False
    assert parachute.order(RELEASE).result(0) is None
    assert parachute.is_released


def test_an_order_needs_the_lease_and_a_release_replaces_another_order(monkeypatch: pytest.MonkeyPatch) -> None:
    with UAL(LightBackend(BackendOptions("uav_1"))) as uav:
        assert not uav.parachute.ordered()
        uav.parachute.enable()
        assert uav.parachute.ordered() == "enable"
        of_other = uav.vehicle.acquire_lease("other", "other", take=False, lease_id="")
        with pytest.raises(LeaseHeldError):
            uav.parachute.release()
        service, answers = VehicleParachute(uav.vehicle), Unanswered()
        monkeypatch.setattr(uav.vehicle, "offer", lambda _: answers)
        enabling = service.enable(of_other)
        with pytest.raises(WrongStateError, match="busy"):
            service.disable(of_other)
        service.release(of_other)
        assert enabling.exception(0) is not None
        assert answers.orders == [ENABLE, RELEASE]


class Unanswered(ParachuteDriver):
    """A parachute that acknowledges nothing."""

    def __init__(self) -> None:
        self.orders: list[ParachuteAction] = []

    def order(self, action: ParachuteAction) -> Future[None]:
        self.orders.append(action)
        return Future()
