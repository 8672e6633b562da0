"""The conformance checks of the autopilot's fence find what is wrong: each with a fence that is sabotaged so."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, cast

import pytest

from ual import conformance
from ual.conformance import CannotRunError, CheckFailedError, Flight, Tolerances, own_fence
from ual.errors import GeofenceError, InvalidArgumentError, WrongStateError
from ual.fences import FencePlan, KeptFence
from ual.interface import Uav
from ual.types import State
from ual_daemon import UAL

TOLERANCES = replace(Tolerances.of_simulation(), patience=1.0)


class Fence:
    """Fence of a UAV that does as it must, but for what a test changes."""

    def __init__(self, uav: UAL) -> None:
        self._uav = uav
        self.kept = KeptFence((), (), is_enabled=False)
        self.checks_zones = self.checks_place = self.checks_flight = True
        self.clears_all_the_same = False

    def get(self) -> KeptFence:
        return self.kept

    def upload(self, plan: FencePlan, *, replace: bool) -> KeptFence:
        self._require_ground()
        if self.checks_zones and (not plan.zones or len(plan.zones[0].points) == 2):
            raise InvalidArgumentError("zones[0]: a polygon has from 3 corners")
        if self.checks_place:
            raise GeofenceError("it is outside the inclusion circle of 100 m")
        return KeptFence(plan.zones)

    def clear(self) -> KeptFence:
        if self.clears_all_the_same:
            self.kept = KeptFence(())
        self._require_ground()
        return self.kept

    def disable(self) -> KeptFence:
        self._require_ground()
        return self.kept

    def _require_ground(self) -> None:
        state = self._uav.state()
        if self.checks_flight and state is not State.LANDED_DISARMED:
            raise WrongStateError("the UAV is armed", {"state": state.name, "needed": "LANDED_DISARMED"})


class WithFence:
    """A UAV that has a fence."""

    def __init__(self, uav: UAL) -> None:
        self._uav = uav
        self.fence = Fence(uav)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._uav, name)


@pytest.fixture(scope="module")
def uav() -> Iterator[UAL]:
    with UAL("light", "uav_1", backend_settings={"speed_factor": 5.0}) as uav:
        yield uav


def run(uav: object) -> None:
    """Runs the checks."""
    flight = Flight(cast("Uav", uav), TOLERANCES)
    for check in (*own_fence.ON_GROUND, *own_fence.IN_FLIGHT):
        conformance.run_check(flight, check)


def test_a_uav_that_does_as_it_must_passes(uav: UAL) -> None:
    run(WithFence(uav))


def test_a_uav_without_a_fence_cannot_be_checked(uav: UAL) -> None:
    with pytest.raises(CannotRunError, match="does not offer them"):
        run(uav)


def takes_any_zone(fence: Fence) -> None:
    fence.checks_zones = False


def takes_it_anywhere(fence: Fence) -> None:
    fence.checks_place = False


def takes_it_in_flight(fence: Fence) -> None:
    fence.checks_flight = False


def clears_before_it_refuses(fence: Fence) -> None:
    fence.clears_all_the_same = True


@pytest.mark.parametrize(
    ("sabotage", "message"),
    [
        (takes_any_zone, "a polygon of two corners"),
        (takes_it_anywhere, "a fence elsewhere"),
        (takes_it_in_flight, "in flight"),
        (clears_before_it_refuses, "has changed the fence"),
    ],
)
def test_what_is_wrong_is_found(uav: UAL, sabotage: Callable[[Fence], None], message: str) -> None:
    sabotaged = WithFence(uav)
    sabotage(sabotaged.fence)
    with pytest.raises(CheckFailedError, match=message):
        run(sabotaged)
