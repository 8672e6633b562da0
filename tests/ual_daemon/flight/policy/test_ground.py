"""Assumed height of the ground: measured while the UAV stood on it, and else the autopilot's home."""

from __future__ import annotations

import pytest

from ual.geometry import Pose
from ual.types import State
from ual_daemon.backends.values import EarthReference, MotionState, Sample, Snapshot
from ual_daemon.flight.policy.ground import ASSUMED_NOISE_M, MEASURED_NOISE_M, Ground
from ual_daemon.flight.state import Estimate
from ual_daemon.geodesy import FlatProjection

FLYING = Estimate(State.FLYING_AUTO, "in the air")
LOST = Estimate(State.UNINITIALIZED, "nothing heard", is_link_up=False)
BLIND = Estimate(State.UNINITIALIZED, "no good position")


def at(z: float, home_m: float | None = 103.0, origin_m: float = 100.0) -> Snapshot:
    projection = FlatProjection(50.0, 10.0, origin_m)
    pose = Sample(Pose.at(0.0, 0.0, z), 0.0)
    return Snapshot(
        0.0, motion=MotionState(pose=pose), earth=EarthReference(projection=projection, home_altitude_amsl_m=home_m)
    )


@pytest.mark.parametrize("landed", [State.LANDED_ARMED, State.LANDED_DISARMED])
def test_the_ground_is_where_the_uav_stood_last(landed: State) -> None:
    ground = Ground()
    for z, state in ((0.1, landed), (0.6, landed), (50.0, State.FLYING_AUTO), (20.0, State.UNINITIALIZED)):
        ground.observe(at(z), Estimate(state, ""))
    assert ground.datum(at(20.0), lambda: 0.0) == (0.6, "the ground of the take-off", MEASURED_NOISE_M)


@pytest.mark.parametrize(
    ("forgetting", "snapshot"), [(LOST, at(5.0)), (FLYING, at(5.0, origin_m=90.0))], ids=["link lost", "frame moved"]
)
def test_what_may_have_changed_is_not_remembered(forgetting: Estimate, snapshot: Snapshot) -> None:
    ground = Ground()
    ground.observe(at(0.6), Estimate(State.LANDED_ARMED, ""))
    ground.observe(snapshot, forgetting)
    assert ground.z_m is None


def test_a_bad_estimate_with_a_link_does_not_forget_the_ground() -> None:
    ground = Ground()
    ground.observe(at(0.6), Estimate(State.LANDED_ARMED, ""))
    ground.observe(at(5.0), BLIND)
    assert ground.z_m == 0.6


def test_a_ground_that_was_not_observed_is_the_autopilots_home() -> None:
    datum = Ground().datum(at(20.0), lambda: 7.0)
    assert (datum.z_m, datum.noise_m) == (3.0, ASSUMED_NOISE_M)
    assert "the autopilot's home" in datum.name


def test_without_a_home_it_is_the_origin_of_odom() -> None:
    assert Ground().datum(at(20.0, home_m=None), lambda: 7.0).z_m == 7.0
