"""Standing by where the UAV does not follow: what is sent once it has hit the ground, until its landing."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import cast

import pytest

from tests.ual_daemon.flight.hand_made import STEP_S, Autopilot
from ual.geometry import Vector3
from ual_daemon.backends.values import PositionSetpoint, Snapshot, VehicleInfo, VelocitySetpoint
from ual_daemon.flight.manoeuvres.fly_reference import ReferenceRules
from ual_daemon.flight.manoeuvres.manoeuvre import Handover, Manoeuvre, Step
from ual_daemon.flight.manoeuvres.stand_by import Here, StandBy
from ual_daemon.flight.policy.following import Following


@dataclass
class Fallen:
    """Words of a watch about a UAV that has fallen."""

    why: str = "it falls"
    has_hit: bool = False
    is_down: bool = False
    is_still: bool = False


LANDING = Handover(cast("Manoeuvre", SimpleNamespace(name="land")))


def stand_by(flying: Autopilot, fallen: Fallen, *, keeps_target: bool) -> StandBy:
    """`keeps_target` is whether the autopilot keeps its own target of a kind of setpoints, as ArduPilot does."""
    info = VehicleInfo(keeps_target_of_a_kind=keeps_target)
    rules = SimpleNamespace(may_send=lambda *_, is_begun: is_begun, backend=SimpleNamespace(info=lambda: info))
    following = cast("Following", fallen)

    def land(_: Snapshot) -> Handover:
        return LANDING

    here = Here(flying.snapshot(), following)
    return StandBy("stand_by", here, cast("ReferenceRules", rules), following=following, land=land)


def kind(step: Step) -> str:
    """Returns what is sent: the present position, no velocity, or that a landing follows."""
    if step.handover is not None:
        return "landing"
    if isinstance(step.setpoint, VelocitySetpoint):
        assert step.setpoint.velocity == Vector3()
        return "velocity"
    assert isinstance(step.setpoint, PositionSetpoint)
    return "position"


def until_landing(flying: Autopilot, manoeuvre: StandBy) -> set[str]:
    """Returns the kinds of the next steps before the landing."""
    found = [kind(flying.step(manoeuvre))]
    while found[-1] != "landing":
        assert len(found) < 1.0 / STEP_S
        found.append(kind(flying.step(manoeuvre)))
    return set(found[:-1])


def test_setpoints_of_another_kind_end_the_target_that_ardupilot_keeps_at_the_impact_and_before_its_landing(
    flying: Autopilot,
) -> None:
    """With positions alone its target was still 3 m up, to which it climbed in LAND (ArduCopter, one dead motor)."""
    fallen = Fallen()
    manoeuvre = stand_by(flying, fallen, keeps_target=True)
    assert kind(flying.step(manoeuvre)) == "position"
    fallen.has_hit = True
    assert kind(flying.step(manoeuvre)) == "velocity"
    assert kind(flying.step(manoeuvre)) == "velocity"
    fallen.is_down = True
    assert until_landing(flying, manoeuvre) == {"position"}


def test_without_an_impact_the_setpoints_before_the_landing_are_velocities(flying: Autopilot) -> None:
    manoeuvre = stand_by(flying, Fallen(is_down=True), keeps_target=True)
    assert until_landing(flying, manoeuvre) == {"velocity"}


@pytest.mark.parametrize("has_hit", [False, True])
def test_an_autopilot_that_takes_each_position_is_landed_at_once(flying: Autopilot, has_hit: bool) -> None:
    fallen = Fallen(has_hit=has_hit)
    manoeuvre = stand_by(flying, fallen, keeps_target=False)
    assert kind(flying.step(manoeuvre)) == "position"
    fallen.is_down = True
    assert until_landing(flying, manoeuvre) == set()
