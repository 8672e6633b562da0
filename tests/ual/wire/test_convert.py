from __future__ import annotations

import copy
import dataclasses
import pickle
from typing import TypeVar

import pytest
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp
from hypothesis import given

from tests.ual import values
from ual.errors import InvalidArgumentError, UalError
from ual.geometry import (
    IDENTITY,
    KEEP_HEADING,
    PointStamped,
    Pose,
    PoseStamped,
    Transform,
    Twist,
    TwistStamped,
    Vector3,
)
from ual.simulation import Fault
from ual.types import (
    AltitudeReference,
    Capability,
    FollowPathRequest,
    Frame,
    GeoWaypoint,
    GoToWaypointGeoRequest,
    GpsFix,
    Info,
    PathHeading,
    Plan,
    ReturnToLaunchRequest,
    State,
    TaskInfo,
    TaskKind,
    TaskStatus,
    Telemetry,
)
from ual.v1 import simulation_pb2 as sim_pb
from ual.v1 import ual_pb2 as pb
from ual.wire import convert, motions, samples, simulation, uav

M = TypeVar("M", bound=Message)


def wire(message: M) -> M:
    """Returns the message that arrives at the other end."""
    return type(message).FromString(message.SerializeToString())


@given(values.stamps)
def test_stamps_keep_their_microseconds(stamp_s: float) -> None:
    message = Timestamp()
    convert.stamp_to_proto(stamp_s, message)
    assert convert.stamp_from_proto(wire(message)) == pytest.approx(stamp_s, rel=0.0, abs=4e-7)
    assert 0 <= message.nanos < 1_000_000_000
    assert round(convert.stamp_from_proto(message) * 1e6) == round(stamp_s * 1e6)


def test_stamps_before_1970_have_nanoseconds_that_count_forward() -> None:
    message = Timestamp()
    convert.stamp_to_proto(-1.25, message)
    assert (message.seconds, message.nanos) == (-2, 750_000_000)
    assert convert.stamp_from_proto(message) == -1.25


@given(values.durations)
def test_durations_keep_their_microseconds(duration_s: float) -> None:
    for signed in (duration_s, -duration_s):
        assert convert.duration_from_proto(wire(convert.duration_to_proto(signed))) == pytest.approx(signed, abs=1e-6)


@given(values.pose_goals)
def test_poses_come_back_as_they_were(pose: PoseStamped) -> None:
    assert convert.pose_stamped_from_proto(wire(convert.pose_stamped_to_proto(pose))) == pose
    assert motions.setpoint_from_proto(wire(motions.setpoint_to_proto(pose))) == pose


@pytest.mark.parametrize("yaw_rad", [None, 0.0, -1.5])
@pytest.mark.parametrize("reference", AltitudeReference)
def test_geographic_waypoints_come_back_as_they_were(reference: AltitudeReference, yaw_rad: float | None) -> None:
    waypoints = [GeoWaypoint(37.4, -6.0, 12.5, reference, yaw_rad), GeoWaypoint(0.0, 0.0, 0.0)]
    request = FollowPathRequest(waypoints)
    assert motions.task_request_from_proto(wire(motions.task_request_to_proto(request))) == request


@given(values.velocities)
def test_velocities_come_back_as_they_were(velocity: TwistStamped) -> None:
    assert motions.setpoint_from_proto(wire(motions.setpoint_to_proto(velocity))) == velocity


def test_the_origin_and_standing_still_are_values_not_absence() -> None:
    pose = PoseStamped(Pose.at(0.0, 0.0, 0.0))
    assert convert.pose_stamped_from_proto(wire(convert.pose_stamped_to_proto(pose))) == pose
    assert motions.setpoint_from_proto(wire(motions.setpoint_to_proto(TwistStamped()))) == TwistStamped()
    still = wire(sim_pb.SetWindRequest(velocity_m_s=convert.vector3_to_proto(Vector3())))
    assert convert.with_part(still, "velocity_m_s", "velocity_m_s") is still


@given(values.transforms)
def test_transforms_come_back_as_they_were(transform: Transform) -> None:
    back = convert.transform_from_proto(wire(convert.transform_to_proto(transform)))
    assert back.stamp_s == pytest.approx(transform.stamp_s, rel=0.0, abs=4e-7)
    assert (back.translation, back.rotation) == (transform.translation, transform.rotation)
    assert (back.frame_id, back.child_frame_id) == (transform.frame_id, transform.child_frame_id)


@given(values.telemetries)
def test_telemetry_comes_back_as_it_was(telemetry: Telemetry) -> None:
    first = wire(samples.telemetry_to_proto(telemetry))
    back = samples.telemetry_from_proto(first, telemetry.missed_count)
    assert wire(samples.telemetry_to_proto(back)) == first
    for field in (
        "state",
        "pose",
        "velocity",
        "reference_pose",
        "position_geo",
        "battery",
        "batteries",
        "gps",
        "task",
        "sequence",
    ):
        if field != "task":
            assert getattr(back, field) == getattr(telemetry, field)
    assert back.missed_count == telemetry.missed_count
    assert (back.odometry is None) == (telemetry.odometry is None)
    assert (back.task is None) == (telemetry.task is None)


def test_a_received_sample_is_as_any_other() -> None:
    made = Telemetry(State.FLYING_AUTO, pose=Pose.at(1.0, 2.0, 3.0), frame_id="uav_1/odom", armed=True)
    message = wire(samples.telemetry_to_proto(made))

    def received() -> Telemetry:
        return samples.telemetry_from_proto(message)

    assert received().pose is not None
    first = received()
    assert first.pose is first.pose  # made once
    assert received() == made
    assert made == received()
    assert hash(received()) == hash(made)
    assert repr(received()) == repr(made)
    assert pickle.loads(pickle.dumps(received())) == made
    assert copy.copy(received()) == copy.deepcopy(received()) == made
    assert dataclasses.replace(received(), missed_count=3) == dataclasses.replace(made, missed_count=3)
    assert not hasattr(received(), "altitude")
    with pytest.raises(dataclasses.FrozenInstanceError):
        received().armed = False  # type: ignore[misc]


@given(values.task_infos, values.ual_errors)
def test_tasks_come_back_with_their_errors(task: TaskInfo, error: UalError) -> None:
    back = uav.task_info_from_proto(wire(uav.task_info_to_proto(task)))
    assert back.elapsed_s == pytest.approx(task.elapsed_s, rel=0.0, abs=1e-6)
    assert (back.id, back.kind, back.status) == (task.id, task.kind, task.status)
    assert (back.progress, back.distance_left_m) == (task.progress, task.distance_left_m)
    assert (back.waypoint_index, back.description, back.error) == (task.waypoint_index, task.description, None)
    assert values.error_equal(convert.task_error_from_proto(wire(convert.task_error_to_proto(error))), error)


def test_a_failed_task_carries_its_error() -> None:
    error = UalError("it fell", {"state": "LANDED_ARMED"})
    task = TaskInfo("1", TaskKind.LAND, TaskStatus.FAILED, error=error)
    assert values.error_equal(uav.task_info_from_proto(wire(uav.task_info_to_proto(task))).error, error)


@given(values.frames)
def test_frames_come_back_as_they_were(frame: Frame) -> None:
    back = uav.frame_from_proto(wire(uav.frame_to_proto(frame)))
    assert (back.frame_id, back.parent_frame_id, back.is_static) == (
        frame.frame_id,
        frame.parent_frame_id,
        frame.is_static,
    )
    assert (back.transform is None) == (frame.transform is None)


@given(values.infos)
def test_info_comes_back_as_it_was(info: Info) -> None:
    assert uav.info_from_proto(wire(uav.info_to_proto(info))) == info


@given(values.faults)
def test_faults_come_back_as_they_were(fault: Fault) -> None:
    assert simulation.fault_from_proto(wire(simulation.fault_to_proto(fault))) == fault
    assert simulation.active_fault_from_proto(wire(simulation.active_fault_to_proto(("f1", fault)))) == ("f1", fault)


def test_capabilities_of_a_newer_daemon_are_left_out() -> None:
    message = pb.GetInfoResponse(capabilities=[pb.CAPABILITY_ARM, pb.Capability.ValueType(99)])
    assert uav.info_from_proto(message).capabilities == {Capability.ARM}


def test_a_better_fix_than_any_known_is_the_best_known() -> None:
    message = pb.Telemetry(state=pb.STATE_LANDING, gps=pb.GpsInfo(fix=pb.GpsFix.ValueType(42)))
    gps = samples.telemetry_from_proto(message).gps
    assert gps is not None
    assert gps.fix is GpsFix.RTK_FIXED


def test_an_orientation_that_is_not_set_keeps_the_heading() -> None:
    request = pb.SetPoseRequest(pose=pb.PoseStamped(pose=pb.Pose(position=pb.Vector3(x=1.0))))
    assert motions.pose_setpoint_from_proto(request).pose == Pose.at(1.0, 0.0, 0.0)
    assert motions.pose_setpoint_from_proto(request).pose.orientation == KEEP_HEADING


def test_parts_of_a_twist_that_are_not_set_are_zero() -> None:
    request = pb.SetVelocityRequest(velocity=pb.TwistStamped(twist=pb.Twist(angular=pb.Vector3(z=1.0))))
    assert motions.velocity_setpoint_from_proto(request).twist == Twist(angular=Vector3(0.0, 0.0, 1.0))
    empty = pb.SetVelocityRequest(velocity=pb.TwistStamped(twist=pb.Twist()))
    assert motions.velocity_setpoint_from_proto(empty).twist == Twist()


def test_a_frame_without_rotation_is_not_rotated() -> None:
    request = pb.AddFrameRequest(transform=pb.Transform(child_frame_id="pad", translation=pb.Vector3(x=1.0)))
    assert motions.new_frame_from_proto(request) == Transform(Vector3(1.0), IDENTITY, "", "pad")


def test_no_altitude_reference_is_home() -> None:
    unset = motions.task_request_from_proto(pb.GoToWaypointGeoRequest())
    assert unset == GoToWaypointGeoRequest(GeoWaypoint(0.0, 0.0, 0.0, AltitudeReference.HOME))
    for reference in AltitudeReference:
        request = GoToWaypointGeoRequest(GeoWaypoint(1.0, 2.0, 3.0, reference), max_speed_m_s=4.0)
        assert motions.task_request_from_proto(motions.task_request_to_proto(request)) == request


@given(values.plans)
def test_plans_come_back_as_they_were(plan: Plan) -> None:
    back = uav.plan_from_proto(wire(uav.plan_to_proto(plan)))
    assert back.length_m == plan.length_m
    assert (back.duration_s is None) == (plan.duration_s is None)
    assert back.duration_s == pytest.approx(plan.duration_s, abs=1e-6)


@given(values.vectors, values.frame_ids)
def test_points_of_interest_come_back_as_they_were(place: Vector3, frame_id: str) -> None:
    point = PointStamped(place, frame_id)
    request = FollowPathRequest([PoseStamped(Pose())], point_of_interest=point)
    assert motions.task_request_from_proto(wire(motions.task_request_to_proto(request))) == request


@pytest.mark.parametrize("request_", [ReturnToLaunchRequest(), ReturnToLaunchRequest(0.0), ReturnToLaunchRequest(12.5)])
def test_returns_home_come_back_as_they_were(request_: ReturnToLaunchRequest) -> None:
    assert motions.task_request_from_proto(wire(motions.task_request_to_proto(request_))) == request_


def test_holds_come_back_as_they_were() -> None:
    request = FollowPathRequest([PoseStamped(Pose())] * 2, holds_s=(0.0, 2.5))
    assert motions.task_request_from_proto(wire(motions.task_request_to_proto(request))) == request


def test_no_path_heading_is_that_of_the_waypoints() -> None:
    assert motions.task_request_from_proto(pb.FollowPathRequest()) == FollowPathRequest([])
    for heading in PathHeading:
        request = FollowPathRequest([PoseStamped(Pose())], heading=heading)
        assert motions.task_request_from_proto(motions.task_request_to_proto(request)) == request


pose_without_position = pb.PoseStamped(pose=pb.Pose(orientation=pb.Quaternion(w=1.0)))
pose_without_pose = pb.PoseStamped(header=pb.Header(frame_id="map"))


@pytest.mark.parametrize(
    ("read", "field"),
    [
        (lambda: motions.task_request_from_proto(pb.GoToWaypointRequest()), "waypoint"),
        (lambda: motions.task_request_from_proto(pb.GoToWaypointRequest(waypoint=pose_without_pose)), "waypoint.pose"),
        (
            lambda: motions.task_request_from_proto(pb.GoToWaypointRequest(waypoint=pose_without_position)),
            "waypoint.pose.position",
        ),
        (
            lambda: motions.task_request_from_proto(
                pb.FollowPathRequest(
                    waypoints=[convert.pose_stamped_to_proto(PoseStamped(Pose())), pose_without_position]
                )
            ),
            "waypoints[1].pose.position",
        ),
        (lambda: motions.pose_setpoint_from_proto(pb.SetPoseRequest()), "pose"),
        (lambda: motions.pose_setpoint_from_proto(pb.SetPoseRequest(pose=pose_without_pose)), "pose.pose"),
        (lambda: motions.velocity_setpoint_from_proto(pb.SetVelocityRequest()), "velocity"),
        (
            lambda: motions.velocity_setpoint_from_proto(pb.SetVelocityRequest(velocity=pb.TwistStamped())),
            "velocity.twist",
        ),
        (lambda: motions.setpoint_from_proto(pb.StreamSetpointsRequest()), "setpoint"),
        (
            lambda: motions.setpoint_from_proto(pb.StreamSetpointsRequest(velocity=pb.TwistStamped())),
            "velocity.twist",
        ),
        (lambda: motions.setpoint_from_proto(pb.StreamSetpointsRequest(pose=pb.PoseStamped())), "pose.pose"),
        (lambda: motions.new_frame_from_proto(pb.AddFrameRequest()), "transform"),
        (
            lambda: motions.task_request_from_proto(pb.FollowPathRequest(point_of_interest=pb.PointStamped())),
            "point_of_interest.point",
        ),
        (
            lambda: motions.task_request_from_proto(pb.FollowPathRequest(heading=pb.PathHeading.ValueType(9))),
            "heading",
        ),
        (lambda: convert.with_part(sim_pb.SetWindRequest(), "velocity_m_s", "velocity_m_s"), "velocity_m_s"),
        (lambda: simulation.fault_from_proto(sim_pb.Fault()), "fault.kind"),
        (
            lambda: simulation.fault_from_proto(sim_pb.Fault(estimator_jumps=sim_pb.EstimatorJumps(period_s=1.0))),
            "fault.estimator_jumps.offset",
        ),
        (
            lambda: motions.task_request_from_proto(
                pb.GoToWaypointGeoRequest(altitude_reference=pb.AltitudeReference.ValueType(7))
            ),
            "altitude_reference",
        ),
        (
            lambda: simulation.fault_from_proto(
                sim_pb.Fault(ack_lost=sim_pb.AckLost(command=sim_pb.Command.ValueType(77)))
            ),
            "fault.ack_lost.command",
        ),
        (lambda: samples.telemetry_from_proto(pb.Telemetry()), "state"),
        (lambda: uav.task_info_from_proto(pb.Task(kind=pb.TASK_KIND_LAND)), "task.status"),
    ],
)
def test_what_is_missing_or_unknown_is_named(read: object, field: str) -> None:
    assert callable(read)
    with pytest.raises(InvalidArgumentError) as caught:
        read()
    assert str(caught.value).startswith(f"{field}: ")
    assert caught.value.metadata["field"] == field
