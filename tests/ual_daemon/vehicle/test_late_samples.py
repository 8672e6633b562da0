"""Samples of which a part is made when it is read: as if all had been made at once."""

from __future__ import annotations

from dataclasses import fields

import pytest

from tests.ual_daemon.stepped import UPDATE_S, Stepped, at, stepped
from ual.geometry import Pose, PoseStamped
from ual.types import Telemetry
from ual_daemon.settings import FrameSettings, VehicleSettings

LATE = ("odometry", "transform", "position_geo", "health")


def is_made(sample: Telemetry, name: str) -> bool:
    try:
        Telemetry.__dict__[name].__get__(sample)
    except AttributeError:
        return False
    return True


def pairs(uav: Stepped) -> list[tuple[Telemetry, Telemetry]]:
    """Gives both kinds of sample of each update from now on, as the list grows."""
    found: list[tuple[Telemetry, Telemetry]] = []
    vehicle = uav.vehicle

    def take(late: Telemetry) -> None:
        found.append((late, vehicle.telemetry()))

    vehicle.subscribe(take, reads_all=False)
    return found


@pytest.mark.parametrize("pose_frame_id", [None, "map", "pad"])
def test_a_late_sample_is_the_same_as_a_whole_one(pose_frame_id: str | None) -> None:
    pad = FrameSettings(frame_id="pad", parent_frame_id="map", translation=(1.0, 2.0, 3.0), yaw_rad=0.7)
    settings = VehicleSettings(home_pose=(4.0, 5.0, 6.0), pose_frame_id=pose_frame_id, frames=(pad,))
    with stepped(settings=settings) as uav:
        uav.fly()
        found = pairs(uav)
        uav.prepare.go_to_waypoint(at(3.0, 2.0, 4.0, 1.0)).begin()
        uav.run(2.0)
    assert len(found) == 2.0 / UPDATE_S
    for late, whole in found:
        assert [name for name in LATE if is_made(late, name)] == []
        assert {each.name: getattr(late, each.name) for each in fields(Telemetry)} == {
            each.name: getattr(whole, each.name) for each in fields(Telemetry)
        }


def test_what_is_read_late_is_as_it_was_then(flying: Stepped) -> None:
    found = pairs(flying)
    flying.run(0.1)
    late, whole = found[-1]
    flying.vehicle.commands.setpoints.set_pose(PoseStamped(Pose.at(3.0, 0.0, 5.0)))
    flying.run(1.0)
    flying.vehicle.commands.setpoints.set_pose(PoseStamped(Pose.at(0.0, 0.0, 5.0)))
    flying.run(0.1)
    assert found[-1][0].odometry != whole.odometry
    assert (late.odometry, late.transform, late.position_geo) == (whole.odometry, whole.transform, whole.position_geo)


def test_a_sample_for_one_that_reads_all_of_it_is_whole(flying: Stepped) -> None:
    late: list[Telemetry] = []
    whole: list[Telemetry] = []
    flying.vehicle.subscribe(late.append, reads_all=False)
    flying.run(0.1)
    end = flying.vehicle.subscribe(whole.append, lambda: len(whole) < 2)
    flying.run(0.5)
    end()
    assert [sample for sample in late if is_made(sample, "odometry")] == whole
