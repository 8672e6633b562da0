"""Poses from outside, from a caller to the light simulation, in whose satellites' place they are taken."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from threading import Thread

import pytest

from ual.errors import (
    InvalidArgumentError,
    NotSupportedError,
    PermissionDeniedError,
    TaskAbortedError,
    UnknownFrameError,
    WrongStateError,
)
from ual.geometry import IDENTITY, Pose, PoseStamped, Quaternion, Transform, Vector3
from ual.simulation import PositionLost
from ual.types import Capability, ExternalPose, State
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.light import LightBackend
from ual_daemon.settings import VehicleSettings

STEP_S = 0.02


class Lab:
    """A light UAV whose time stands still, and a motion capture in ``map``."""

    def __init__(self, settings: VehicleSettings | None = None, *, watch_only: bool = False) -> None:
        self.backend = LightBackend(BackendOptions("uav_1", settings={"speed_factor": 0.0}))
        self.uav = UAL(self.backend, settings=settings, watch_only=watch_only)
        self.uav.simulation.step(STEP_S)

    def measure(self, position: Vector3, frame_id: str = "map", *, yaw_rad: float = 0.0, age_s: float = 0.0) -> str:
        """Gives one pose of a stream, after a step."""
        self.uav.simulation.step(STEP_S)
        return self.offer(position, frame_id, yaw_rad=yaw_rad, age_s=age_s)

    def offer(self, position: Vector3, frame_id: str = "map", *, yaw_rad: float = 0.0, age_s: float = 0.0) -> str:
        pose = Pose(position, Quaternion.from_yaw(yaw_rad))
        stamped = PoseStamped(pose, frame_id, self.backend.utc_s() - age_s)
        return self.uav.vehicle.external_poses.offer(ExternalPose(stamped))

    def position(self) -> Vector3:
        return self.uav.pose().pose.position


@pytest.fixture
def lab() -> Iterator[Lab]:
    lab = Lab()
    yield lab
    lab.uav.vehicle.close()


def test_they_replace_satellites_and_a_source_that_stops_is_named(lab: Lab) -> None:
    lab.uav.simulation.begin_fault(PositionLost())
    lab.uav.simulation.step(STEP_S)
    assert lab.uav.state() is State.UNINITIALIZED
    assert "poses from outside" not in lab.uav.telemetry().state_reason
    place = Vector3(1.0, 2.0, 0.0)
    assert not lab.measure(place)
    lab.uav.simulation.step(STEP_S)
    assert lab.uav.state() is State.LANDED_DISARMED
    assert (lab.position() - place).norm() < 1e-6
    lab.uav.simulation.step(1.2 - STEP_S)
    assert lab.uav.state() is State.UNINITIALIZED
    assert lab.uav.telemetry().state_reason.endswith("; no poses from outside for 1.2 s")


def test_a_position_that_is_good_long_after_them_does_not_rest_on_them(lab: Lab) -> None:
    """One pose ever, and each later loss of a vehicle with satellites blamed "no poses from outside for 746 s"."""
    assert not lab.measure(Vector3(1.0, 2.0, 0.0))
    lab.uav.simulation.step(30.0)
    assert lab.uav.state() is State.LANDED_DISARMED
    lab.uav.simulation.begin_fault(PositionLost())
    lab.uav.simulation.step(STEP_S)
    assert lab.uav.state() is State.UNINITIALIZED
    assert "poses from outside" not in lab.uav.telemetry().state_reason


def test_with_satellites_they_change_nothing(lab: Lab) -> None:
    lab.measure(Vector3(1.0, 2.0, 0.0))
    lab.uav.simulation.step(2.0)
    assert lab.uav.state() is State.LANDED_DISARMED
    assert lab.position() == Vector3()


def test_it_flies_on_them(lab: Lab) -> None:
    """They are its true poses. It climbs in them, though its satellites are gone."""
    lab.uav.simulation.begin_fault(PositionLost())
    world = lab.backend.world

    def measured_step() -> None:
        x, y, z = world.fleet.position[0]
        assert not lab.measure(Vector3(x, y, z))

    for _ in range(5):
        measured_step()
    lab.uav.simulation.pilot_arm()
    measured_step()
    task = lab.uav.take_off(2.0, blocking=False)
    for _ in range(1000):
        measured_step()
        if task.done():
            break
    assert lab.uav.state() is State.FLYING_AUTO
    assert world.fleet.position[0][2] == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("moved_m", [0.5, 0.9, 3.0])
def test_a_source_that_moves_in_flight_ends_the_go_to_and_the_uav_stays(lab: Lab, moved_m: float) -> None:
    """Its camera was knocked: all poses are elsewhere from then on."""
    lab.uav.simulation.begin_fault(PositionLost())
    world, uav, shift = lab.backend.world, lab.uav, Vector3()

    def steps(count: int, done: Callable[[], bool] = lambda: False) -> None:
        for _ in range(count):
            lab.measure(Vector3(*world.fleet.position[0]) + shift)
            if done():
                return

    steps(5)
    uav.simulation.pilot_arm()
    steps(2)
    steps(1000, uav.take_off(2.0, blocking=False).done)
    task = uav.go_to_waypoint(Pose.at(20.0, 0.0, 2.0), blocking=False)
    steps(100)
    shift = Vector3(0.0, moved_m, 0.0)
    steps(200, task.done)
    with pytest.raises(TaskAbortedError, match="jump"):
        task.wait(0.0)
    steps(150)  # its poses count again
    assert lab.position().y == pytest.approx(moved_m, abs=0.1)
    recovering = Thread(target=uav.recover_from_manual, kwargs={"force": True})
    recovering.start()
    while recovering.is_alive():
        steps(1)
    steps(150)
    assert uav.state() is State.FLYING_AUTO
    assert world.fleet.position[0][1] == pytest.approx(0.0, abs=0.1)


def test_the_reason_says_why_poses_are_dropped(lab: Lab) -> None:
    lab.uav.simulation.begin_fault(PositionLost())
    for _ in range(60):
        lab.measure(Vector3(), age_s=0.3)
    assert lab.uav.state() is State.UNINITIALIZED
    assert lab.uav.telemetry().state_reason.endswith("; the poses from outside are dropped: it is old")


def test_the_reason_says_why_poses_are_refused(lab: Lab) -> None:
    lab.uav.simulation.begin_fault(PositionLost())
    lab.measure(Vector3())
    for _ in range(60):
        with pytest.raises(UnknownFrameError):
            lab.measure(Vector3(), "nowhere")
    assert lab.uav.state() is State.UNINITIALIZED
    assert "; the poses from outside are dropped: " in lab.uav.telemetry().state_reason
    assert "nowhere" in lab.uav.telemetry().state_reason


def test_frames_are_converted_and_home_does_not_move_what_is_measured_in_map(lab: Lab) -> None:
    uav = lab.uav
    uav.add_frame(Transform(Vector3(10.0, 0.0, 0.0), Quaternion.from_yaw(math.pi / 2), "map", "camera"))
    uav.simulation.begin_fault(PositionLost())
    lab.measure(Vector3(1.0, 0.0, 0.0), "camera")
    uav.simulation.step(STEP_S)
    assert (lab.position() - Vector3(10.0, 1.0, 0.0)).norm() < 1e-6
    uav.set_home()
    for frame_id in ("map", "camera"):
        lab.measure(Vector3(10.0, 1.0, 0.0) if frame_id == "map" else Vector3(1.0, 0.0, 0.0), frame_id)
        uav.simulation.step(STEP_S)
        assert lab.position().norm() < 1e-6, frame_id
    lab.measure(Vector3(), "uav_1/odom")
    uav.simulation.step(STEP_S)
    assert lab.position().norm() < 1e-6


def test_map_with_an_origin_on_earth_is_where_it_is_on_earth() -> None:
    lab = Lab(VehicleSettings(map_origin_geo=(47.397742, 8.545594, 488.0)))
    lab.uav.simulation.begin_fault(PositionLost())
    there = lab.uav.transform("map", "uav_1/odom").apply(Vector3(3.0, 4.0, 0.0))
    lab.measure(there)
    lab.uav.simulation.step(STEP_S)
    assert (lab.position() - Vector3(3.0, 4.0, 0.0)).norm() < 1e-6
    lab.uav.vehicle.close()


def test_a_jump_is_dropped_and_logged(lab: Lab, caplog: pytest.LogCaptureFixture) -> None:
    lab.uav.simulation.begin_fault(PositionLost())
    lab.measure(Vector3())
    with caplog.at_level(logging.WARNING):
        why = lab.measure(Vector3(50.0, 0.0, 0.0))
    assert why.startswith("it jumps as no vehicle flies: 50.00 m")
    assert [vars(record).get("ual_event") for record in caplog.records].count("external_pose_dropped") == 1
    lab.uav.simulation.step(STEP_S)
    assert lab.position().norm() < 1e-6


def test_a_source_that_goes_on_elsewhere_is_followed(lab: Lab, caplog: pytest.LogCaptureFixture) -> None:
    lab.uav.simulation.begin_fault(PositionLost())
    lab.measure(Vector3())
    with caplog.at_level(logging.WARNING):
        while lab.measure(Vector3(50.0, 0.0, 0.0)):
            pass
    assert "external_poses_moved" in [vars(record).get("ual_event") for record in caplog.records]
    lab.uav.simulation.step(STEP_S)
    assert (lab.position() - Vector3(50.0, 0.0, 0.0)).norm() < 1e-6


def test_a_single_pose_that_is_old_is_refused_and_one_of_a_stream_dropped(lab: Lab) -> None:
    old = PoseStamped(Pose(Vector3(), IDENTITY), "map", lab.backend.utc_s() - 0.3)
    with pytest.raises(InvalidArgumentError, match=r"pose.header.stamp: it is old: measured 0.30 s ago"):
        lab.uav.set_external_pose(old)
    lab.uav.set_external_pose(PoseStamped(Pose(Vector3(), IDENTITY), "map"))
    lab.uav.set_external_pose(old)
    assert lab.offer(Vector3(), age_s=0.01).startswith("it is older than the one before")


@pytest.mark.parametrize(
    ("pose", "kind", "match"),
    [
        (PoseStamped(Pose.at(0.0, 0.0, 0.0), "map"), InvalidArgumentError, "is not a rotation"),
        (PoseStamped(Pose.at(math.nan, 0.0, 0.0, 0.0), "map"), InvalidArgumentError, "pose.pose.position.x"),
        (PoseStamped(Pose.at(0.0, 0.0, 0.0, 0.0), "nowhere"), UnknownFrameError, "known are map"),
        (PoseStamped(Pose.at(0.0, 0.0, 0.0, 0.0), "uav_1/base_link"), InvalidArgumentError, "moves with the UAV"),
        (PoseStamped(Pose.at(0.0, 0.0, 0.0, 0.0), "map", math.inf), InvalidArgumentError, "pose.header.stamp"),
    ],
)
def test_what_is_not_valid_is_refused(lab: Lab, pose: PoseStamped, kind: type[Exception], match: str) -> None:
    with pytest.raises(kind, match=match):
        lab.uav.set_external_pose(pose)


def test_map_that_is_not_placed_on_earth_yet_is_refused() -> None:
    backend = LightBackend(BackendOptions("uav_1", settings={"speed_factor": 0.0}))
    uav = UAL(backend, settings=VehicleSettings(map_origin_geo=(47.397742, 8.545594, 488.0)))  # no update came yet
    with pytest.raises(WrongStateError):
        uav.set_external_pose(PoseStamped(Pose.at(0.0, 0.0, 0.0, 0.0), "map"))
    uav.vehicle.close()


def test_a_daemon_that_only_watches_gives_none() -> None:
    lab = Lab(watch_only=True)
    with pytest.raises(PermissionDeniedError):
        lab.uav.set_external_pose(PoseStamped(Pose.at(0.0, 0.0, 0.0, 0.0), "map"))
    lab.uav.vehicle.close()


def test_a_backend_without_them_says_so(lab: Lab) -> None:
    info = lab.backend.info()
    lab.backend.info = lambda: replace(info, capabilities=frozenset({Capability.LAND}))  # type: ignore[method-assign]
    with pytest.raises(NotSupportedError, match="set_external_pose"):
        lab.uav.set_external_pose(PoseStamped(Pose.at(0.0, 0.0, 0.0, 0.0), "map"))


def test_a_flood_is_thinned_without_a_path_in_the_log(lab: Lab, caplog: pytest.LogCaptureFixture) -> None:
    assert not lab.measure(Vector3())
    with caplog.at_level(logging.WARNING):
        for _ in range(100):
            assert lab.offer(Vector3()).startswith("it comes too soon")
    assert caplog.records == []


def test_two_senders_a_little_apart_are_reported_and_a_step_is_logged(
    lab: Lab, caplog: pytest.LogCaptureFixture
) -> None:
    lab.uav.simulation.begin_fault(PositionLost())
    for _ in range(60):
        lab.measure(Vector3())
    lab.measure(Vector3(0.3, 0.0, 0.0))
    assert "external_pose_step" in caplog.text
    for number in range(60):
        lab.measure(Vector3(0.3 * (number % 2), 0.0, 0.0))
    health = lab.uav.telemetry().health
    assert health is not None
    assert "position: poses from outside step to and fro by 0.3 m: they come from two sources" in health.failing_checks
    for _ in range(80):
        lab.measure(Vector3())
    assert "two sources" not in str(lab.uav.telemetry().health)


def test_a_step_of_half_a_metre_is_dropped_whatever_the_limits_allow(lab: Lab) -> None:
    lab.uav.simulation.begin_fault(PositionLost())
    for _ in range(60):
        assert not lab.measure(Vector3())
    assert lab.measure(Vector3(0.5, 0.0, 0.0)).startswith("it jumps as no vehicle flies")
