"""The commands that fly, and those that ask about a flight."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Mapping
from typing import Any, TypeAlias

from std_srvs.srv import Empty, Trigger
from ual_msgs import action, msg, srv

import ual
from ual.interface import DryRun
from ual_ros2 import routes, values
from ual_ros2.beside.filling import Filling
from ual_ros2.command import Action, Command
from ual_ros2.derived.values import frame_fields, plan_fields, task_fields
from ual_ros2.messages import Entity, Message

Flyer: TypeAlias = ual.aio.Uav | DryRun[Any]
"""What flies, or only says what would happen: both have the same members."""
_filled = Filling().filled


def _of_waypoint(request: Message) -> Iterable[str]:
    return (request.waypoint.header.frame_id,)


def _of_path(goal: Message) -> Iterable[str]:
    stamped = (goal.path, goal.point_of_interest, *goal.path.poses)
    return [each.header.frame_id for each in stamped]


def _told_task(begun: ual.aio.Task) -> Mapping[str, Message]:
    return {"task_id": begun.id}


def _told_motion(ended: ual.aio.Task | ual.types.Plan) -> Mapping[str, Message]:
    if isinstance(ended, ual.types.Plan):
        return {"plan": _filled(msg.Plan(), plan_fields(ended))}
    return _told_task(ended)


def _go_to_geo(uav: ual.aio.Uav, request: Message) -> Awaitable[object]:
    place = request.waypoint
    reference = values.altitude_reference(request.altitude_reference)
    return uav.go_to_waypoint_geo(place.latitude, place.longitude, place.altitude, reference, blocking=request.blocking)


def _fly_to_geo(flyer: Flyer, goal: Message) -> Awaitable[object]:
    place = values.geo_waypoint(goal)
    return flyer.go_to_waypoint_geo(
        place.latitude_deg,
        place.longitude_deg,
        place.altitude_m,
        place.altitude_reference,
        yaw_rad=place.yaw_rad,
        max_speed_m_s=values.speed(goal.max_speed),
    )


def _follow_path(flyer: Flyer, goal: Message) -> Awaitable[object]:
    heading = values.path_heading(goal.heading)
    is_at_point = heading is ual.PathHeading.POINT_OF_INTEREST
    return flyer.follow_path(
        values.waypoints(goal),
        corner_radius_m=goal.corner_radius,
        max_speed_m_s=values.speed(goal.max_speed),
        leg_speeds_m_s=list(goal.leg_speeds),
        heading=heading,
        point_of_interest=values.point_stamped(goal.point_of_interest) if is_at_point else None,
        holds_s=list(goal.holds),
    )


async def _set_pose(uav: ual.aio.Uav, request: Message) -> None:
    """Asks before it gives: what topics stream is answered later, and this caller wants its own answer."""
    pose = values.pose_stamped(request.pose)
    await uav.dry_run.set_pose(pose)
    if not request.dry_run:
        await uav.set_pose(pose)


async def _set_velocity(uav: ual.aio.Uav, request: Message) -> None:
    velocity = values.twist_stamped(request.velocity)
    await uav.dry_run.set_velocity(velocity)
    if not request.dry_run:
        await uav.set_velocity(velocity)


def _set_external_pose(uav: ual.aio.Uav, request: Message) -> Awaitable[object]:
    return uav.set_external_pose(
        values.pose_stamped(request.pose, stamp_s=values.stamp_s(request.pose.header.stamp)),
        position_std_dev_m=request.position_std_dev if request.has_position_std_dev else None,
        orientation_std_dev_rad=request.orientation_std_dev if request.has_orientation_std_dev else None,
    )


def _take_control(uav: ual.aio.Uav, request: Message) -> Awaitable[object]:
    flyer: Flyer = uav.dry_run if request.dry_run else uav
    return flyer.recover_from_manual(force=request.force)


async def _get_task(uav: ual.aio.Uav, request: Message) -> ual.TaskInfo:
    return await (await uav.task(request.task_id)).info()


def _told_info(info: ual.TaskInfo) -> Mapping[str, Message]:
    return {"task": _filled(msg.Task(), task_fields(info))}


async def _cancel_task(uav: ual.aio.Uav, request: Message) -> None:
    await (await uav.task(request.task_id)).cancel()


async def _pause_task(uav: ual.aio.Uav, request: Message) -> None:
    await (await uav.task(request.task_id)).pause()


async def _resume_task(uav: ual.aio.Uav, request: Message) -> None:
    await (await uav.task(request.task_id)).resume()


def _add_frame(uav: ual.aio.Uav, request: Message) -> Awaitable[object]:
    return uav.add_frame(values.transform_stamped(request.transform, values.stamp_s(request.transform.header.stamp)))


def _told_frames(frames: list[ual.Frame]) -> Mapping[str, Message]:
    return {"frames": [_filled(msg.Frame(), frame_fields(each)) for each in frames]}


async def _get_route(uav: ual.aio.Uav, _: Message) -> Mapping[str, Message]:
    route = await uav.route()
    told = {"is_flown": route is not None, "route": await routes.path(route)}
    return told if route is None else {**told, "task_id": route.task_id, "is_goal_moving": route.is_goal_moving}


SERVICES = (
    Command(
        "take_off",
        srv.TakeOff,
        lambda uav, request: uav.take_off(request.height, blocking=request.blocking),
        told=_told_task,
    ),
    Command("land", srv.Land, lambda uav, request: uav.land(blocking=request.blocking), told=_told_task),
    Command(
        "go_to_waypoint",
        srv.GoToWaypoint,
        lambda uav, request: uav.go_to_waypoint(values.pose_stamped(request.waypoint), blocking=request.blocking),
        _of_waypoint,
        _told_task,
    ),
    Command("go_to_waypoint_geo", srv.GoToWaypointGeo, _go_to_geo, told=_told_task),
    Command(
        "return_to_launch",
        srv.ReturnToLaunch,
        lambda uav, request: uav.return_to_launch(values.height(request.height), blocking=request.blocking),
        told=_told_task,
    ),
    Command("set_home", srv.SetHome, lambda uav, request: uav.set_home(request.set_z)),
    Command("abort", srv.Abort, lambda uav, request: uav.abort(request.freeze)),
    Command("recover_from_manual", Empty, lambda uav, _: uav.recover_from_manual()),
    Command("recover", Trigger, lambda uav, _: uav.recover_from_manual(), method="RecoverFromManual"),
    Command("take_control", srv.TakeControl, _take_control, method="RecoverFromManual"),
    Command("arm", Trigger, lambda uav, _: uav.arm()),
    Command("disarm", Trigger, lambda uav, _: uav.disarm()),
    Command("pause", Trigger, lambda uav, _: uav.pause()),
    Command("resume", Trigger, lambda uav, _: uav.resume()),
    Command("set_pose", srv.SetPose, _set_pose, lambda request: (request.pose.header.frame_id,)),
    Command("set_velocity", srv.SetVelocity, _set_velocity, lambda request: (request.velocity.header.frame_id,)),
    Command(
        "set_external_pose",
        srv.SetExternalPose,
        _set_external_pose,
        stamps=lambda request: (request.pose.header.stamp,),
    ),
    Command("get_task", srv.GetTask, _get_task, told=_told_info),
    Command("cancel_task", srv.OrderTask, _cancel_task, method="Abort"),
    Command("pause_task", srv.OrderTask, _pause_task, method="Pause"),
    Command("resume_task", srv.OrderTask, _resume_task, method="Resume"),
    Command("get_route", srv.GetRoute, _get_route, told=lambda route: route),
    Command(
        "add_frame",
        srv.AddFrame,
        _add_frame,
        lambda request: (request.transform.header.frame_id,),
        stamps=lambda request: (request.transform.header.stamp,),
        changes_frames=True,
    ),
    Command(
        "remove_frame",
        srv.RemoveFrame,
        lambda uav, request: uav.remove_frame(request.frame_id),
        changes_frames=True,
    ),
    Command("list_frames", srv.ListFrames, lambda uav, _: uav.frames(), told=_told_frames),
)


def _motion(
    name: str,
    kind: Entity,
    call: Callable[[Flyer, Message], Awaitable[object]],
    frames: Callable[[Message], Iterable[str]] = lambda _: (),
    *,
    can_be_cancelled: bool = True,
) -> Action:
    """An action of a motion, which may only be asked what it would be."""

    def fly_or_ask(uav: ual.aio.Uav, goal: Message) -> Awaitable[object]:
        return call(uav.dry_run if goal.dry_run else uav, goal)

    return Action(
        name,
        kind,
        fly_or_ask,
        frames,
        _told_motion,
        can_be_cancelled=can_be_cancelled,
    )


# The names are those of the services: ROS keeps the two apart.
ACTIONS = (
    _motion(
        "take_off",
        action.TakeOff,
        lambda flyer, goal: flyer.take_off(goal.height, force=goal.force),
        can_be_cancelled=False,
    ),
    _motion("land", action.Land, lambda flyer, _: flyer.land(), can_be_cancelled=False),
    _motion(
        "go_to_waypoint",
        action.GoToWaypoint,
        lambda flyer, goal: flyer.go_to_waypoint(
            values.pose_stamped(goal.waypoint), max_speed_m_s=values.speed(goal.max_speed)
        ),
        _of_waypoint,
    ),
    _motion("go_to_waypoint_geo", action.GoToWaypointGeo, _fly_to_geo),
    _motion("follow_path", action.FollowPath, _follow_path, _of_path),
    _motion(
        "return_to_launch",
        action.ReturnToLaunch,
        lambda flyer, goal: flyer.return_to_launch(values.height(goal.height)),
    ),
)
