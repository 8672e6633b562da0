"""Setpoints in the form that an autopilot takes, and how straight a light UAV flies by velocities alone."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import pytest

from tests.ual_daemon.stepped import at, stepped
from ual.geometry import Pose, Quaternion, Vector3
from ual.types import Limits
from ual_daemon.backends.values import (
    MotionState,
    PositionSetpoint,
    Sample,
    Snapshot,
    Takes,
    VehicleInfo,
    VelocityGains,
    VelocitySetpoint,
)
from ual_daemon.settings import LimitSettings, VehicleSettings
from ual_daemon.tracker.setpoint_adaptation import adapted

HERE = Snapshot(0.0, motion=MotionState(pose=Sample(Pose(Vector3(1.0, 2.0, 3.0), Quaternion.from_yaw(3.0)), 0.0)))
MOVING = PositionSetpoint(Vector3(2.0, 2.0, 3.0), -3.0, Vector3(0.5), Vector3(0.1), 0.2)
STANDING = PositionSetpoint(Vector3(2.0, 2.0, 3.0), -3.0)
NO_LIMITS = Limits(*(1e6,) * 6)
FAST = {"horizontal_speed_m_s": 8.0, "vertical_speed_m_s": 3.0, "horizontal_acceleration_m_s2": 3.0}
AS_FAST_AS_IT_IS = VehicleSettings(limits=LimitSettings(**{field.name: 100.0 for field in fields(Limits)}))


def sent(setpoint: PositionSetpoint, takes: Takes, gains: VelocityGains | None = None) -> object:
    return adapted(setpoint, VehicleInfo(takes=takes, velocity_gains=gains or VelocityGains()), HERE, lambda: NO_LIMITS)


def test_an_autopilot_that_takes_all_gets_the_setpoint_itself() -> None:
    assert sent(MOVING, Takes.ALL) is MOVING
    assert sent(MOVING, Takes.POSITION | Takes.FEED_FORWARD) is MOVING


def test_an_autopilot_that_takes_positions_gets_no_feed_forward() -> None:
    assert sent(MOVING, Takes.POSITION) == STANDING


def test_an_autopilot_without_feed_forward_moves_by_velocities_and_holds_by_positions() -> None:
    takes = Takes.POSITION | Takes.VELOCITY
    assert isinstance(sent(MOVING, takes), VelocitySetpoint)
    assert sent(STANDING, takes) == STANDING


def test_a_velocity_leads_by_the_response_and_corrects_the_error() -> None:
    gains = VelocityGains(position_per_s=2.0, yaw_per_s=1.0, response_s=0.5)
    found = sent(MOVING, Takes.VELOCITY, gains)
    assert isinstance(found, VelocitySetpoint)
    assert found.velocity.x == pytest.approx(0.5 + 0.5 * 0.1 + 2.0 * 1.0)
    assert found.velocity.y == found.velocity.z == 0.0
    assert found.yaw_rate_rad_s == pytest.approx(0.2 + math.tau - 6.0)  # the shorter way, through pi


def test_a_velocity_stays_within_the_limits_and_keeps_its_direction() -> None:
    goal = PositionSetpoint(Vector3(101.0, 2.0, 103.0), 3.0)
    far = adapted(goal, VehicleInfo(takes=Takes.VELOCITY), HERE, Limits)
    assert isinstance(far, VelocitySetpoint)
    assert far.velocity.horizontal_norm() <= 1.6 + 1e-9
    assert far.velocity.z <= 1.2 + 1e-9
    assert math.isclose(far.velocity.x, far.velocity.z)


@pytest.mark.parametrize("takes", [Takes.ALL, Takes.POSITION, Takes.VELOCITY])
def test_velocities_are_sent_as_they_are(takes: Takes) -> None:
    velocity = VelocitySetpoint(Vector3(1.0), 0.1)
    assert adapted(velocity, VehicleInfo(takes=takes), HERE, Limits) is velocity


def executed(takes: str, light: dict[str, Any]) -> tuple[float, float, float]:
    """Returns the duration of a go-to with a quarter turn in s, its widest distance from the line, and overshoot."""
    with stepped(AS_FAST_AS_IT_IS, light={**light, "takes": takes}) as uav:
        uav.fly()
        begin = uav.pose.position
        way = Vector3(15.0, 10.0, 5.0)
        goal = begin + way
        uav.keep_samples()
        uav.end(uav.prepare.go_to_waypoint(at(goal.x, goal.y, goal.z, math.pi / 2)).begin().future)
        duration_s = len(uav.samples) * 0.02
        uav.run(3.0)
        along = way / way.norm()
        offsets = [sample.pose.position - begin for sample in uav.samples if sample.pose]
        widest_m = max((offset - along * offset.dot(along)).norm() for offset in offsets)
        return duration_s, widest_m, max(offset.dot(along) for offset in offsets) - way.norm()


@pytest.mark.parametrize("light", [{}, FAST], ids=["slow", "fast"])
def test_by_velocities_alone_it_flies_as_fast_and_straight_as_with_feed_forward(light: dict[str, Any]) -> None:
    full_s, _, _ = executed("all", light)
    duration_s, widest_m, overshoot_m = executed("velocities", light)
    assert duration_s <= 1.05 * full_s
    assert overshoot_m < 0.02
    assert widest_m < 0.02
