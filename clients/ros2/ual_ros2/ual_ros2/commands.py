"""The commands: which service or action each is, and which member of the client it calls with what."""

from __future__ import annotations

from collections.abc import Awaitable, Iterable, Mapping

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from std_srvs.srv import Empty, Trigger
from ual_msgs import action, msg, srv

import ual
from ual.cameras import Photo
from ual.gripper import Equipment
from ual.parameters.values import Parameter
from ual_ros2 import payload, pictures, values
from ual_ros2.command import Action, Command
from ual_ros2.messages import Message


def _of_waypoint(request: Message) -> Iterable[str]:
    return (request.waypoint.header.frame_id,)


def _of_path(goal: Message) -> Iterable[str]:
    stamped = (goal.path, goal.point_of_interest, *goal.path.poses)
    return [each.header.frame_id for each in stamped]


def _go_to_geo(uav: ual.aio.Uav, request: Message) -> Awaitable[object]:
    place = request.waypoint
    reference = values.altitude_reference(request.altitude_reference)
    return uav.go_to_waypoint_geo(place.latitude, place.longitude, place.altitude, reference, blocking=request.blocking)


def _fly_to_geo(uav: ual.aio.Uav, goal: Message) -> Awaitable[object]:
    place = goal.waypoint
    return uav.go_to_waypoint_geo(
        place.latitude,
        place.longitude,
        place.altitude,
        values.altitude_reference(goal.altitude_reference),
        yaw_rad=goal.yaw if goal.has_yaw else None,
        max_speed_m_s=values.speed(goal.max_speed),
    )


def _follow_path(uav: ual.aio.Uav, goal: Message) -> Awaitable[object]:
    heading = values.path_heading(goal.heading)
    is_at_point = heading is ual.PathHeading.POINT_OF_INTEREST
    return uav.follow_path(
        values.path(goal.path),
        corner_radius_m=goal.corner_radius,
        max_speed_m_s=values.speed(goal.max_speed),
        leg_speeds_m_s=list(goal.leg_speeds),
        heading=heading,
        point_of_interest=values.point_stamped(goal.point_of_interest) if is_at_point else None,
        holds_s=list(goal.holds),
    )


def _parameter(read: Parameter) -> Message:
    return msg.Parameter(
        name=read.name,
        value=float(read.value),
        type=read.type.name,
        is_relied_on=read.is_relied_on,
        minimum=values.known(read.minimum),
        maximum=values.known(read.maximum),
        unit=read.unit,
        description=read.description,
        needs_reboot=read.needs_reboot,
    )


def _told_parameter(read: Parameter) -> Mapping[str, Message]:
    return {"parameter": _parameter(read)}


def _told_parameters(read: list[Parameter]) -> Mapping[str, Message]:
    return {"parameters": [_parameter(each) for each in read]}


def _told_photo(photo: Photo) -> Mapping[str, Message]:
    body, camera = PoseStamped(), PoseStamped()
    pictures.fill_pose_stamped(body, photo.body)
    if photo.camera is not None:
        there = ual.PoseStamped(pictures.optical(photo.camera.pose), photo.camera.frame_id)
        pictures.fill_pose_stamped(camera, there)
    stamp = Time()
    stamp.sec, stamp.nanosec = values.split(photo.stamp_s)
    for each in (body, camera):
        each.header.stamp = stamp
    return {
        "number": photo.number,
        "stamp": stamp,
        "is_stored": photo.is_stored,
        "body": body,
        "optical": camera,
        "file_url": photo.file_url,
    }


def _start_photos(uav: ual.aio.Uav, request: Message) -> Awaitable[object]:
    interval_s, distance_m = request.interval or None, request.distance or None
    return uav.cameras[request.camera].start_photos(interval_s=interval_s, distance_m=distance_m, count=request.count)


def _told_devices(found: Equipment) -> Mapping[str, Message]:
    return {"devices": [msg.Device(**each) for each in payload.devices(found)]}


def _order_winch(uav: ual.aio.Uav, request: Message) -> Awaitable[object]:
    chosen, length_m, rate_m_s = payload.winch_order(request)
    return uav.gripper.order_winch(chosen, winch=request.winch, length_m=length_m, rate_m_s=rate_m_s)


SERVICES = (
    Command("take_off", srv.TakeOff, lambda uav, request: uav.take_off(request.height, blocking=request.blocking)),
    Command("land", srv.Land, lambda uav, request: uav.land(blocking=request.blocking)),
    Command(
        "go_to_waypoint",
        srv.GoToWaypoint,
        lambda uav, request: uav.go_to_waypoint(values.pose_stamped(request.waypoint), blocking=request.blocking),
        _of_waypoint,
    ),
    Command("go_to_waypoint_geo", srv.GoToWaypointGeo, _go_to_geo),
    Command(
        "return_to_launch",
        srv.ReturnToLaunch,
        lambda uav, request: uav.return_to_launch(values.height(request.height), blocking=request.blocking),
    ),
    Command("set_home", srv.SetHome, lambda uav, request: uav.set_home(request.set_z)),
    Command("abort", srv.Abort, lambda uav, request: uav.abort(request.freeze)),
    Command("recover_from_manual", Empty, lambda uav, _: uav.recover_from_manual()),
    Command("recover", Trigger, lambda uav, _: uav.recover_from_manual()),
    Command("arm", Trigger, lambda uav, _: uav.arm()),
    Command("disarm", Trigger, lambda uav, _: uav.disarm()),
    Command("pause", Trigger, lambda uav, _: uav.pause()),
    Command("resume", Trigger, lambda uav, _: uav.resume()),
    Command(
        "get_parameter", srv.GetParameter, lambda uav, request: uav.parameters.get(request.name), told=_told_parameter
    ),
    Command("list_parameters", srv.ListParameters, lambda uav, _: uav.parameters.get_all(), told=_told_parameters),
    Command(
        "set_parameter",
        srv.SetParameter,
        lambda uav, request: uav.parameters.set(request.name, request.value, force=request.force),
        told=_told_parameter,
    ),
    Command(
        "take_photo", srv.TakePhoto, lambda uav, request: uav.cameras[request.camera].take_photo(), told=_told_photo
    ),
    Command("start_photos", srv.StartPhotos, _start_photos),
    Command("stop_photos", srv.OrderCamera, lambda uav, request: uav.cameras[request.camera].stop_photos()),
    Command("start_video", srv.OrderCamera, lambda uav, request: uav.cameras[request.camera].start_video()),
    Command("stop_video", srv.OrderCamera, lambda uav, request: uav.cameras[request.camera].stop_video()),
    Command("grip", srv.MoveGripper, lambda uav, request: uav.gripper.grip(request.gripper)),
    Command("release", srv.MoveGripper, lambda uav, request: uav.gripper.release(request.gripper)),
    Command("order_winch", srv.OrderWinch, _order_winch),
    Command(
        "set_servo",
        srv.SetServo,
        lambda uav, request: uav.gripper.set_servo(
            request.position, servo=request.servo, pwm_us=request.pwm_us or None
        ),
    ),
    Command("set_relay", srv.SetRelay, lambda uav, request: uav.gripper.set_relay(request.state, relay=request.relay)),
    Command("list_equipment", srv.ListEquipment, lambda uav, _: uav.gripper.get_all(), told=_told_devices),
)

# The names are those of the services: ROS keeps the two apart.
ACTIONS = (
    Action(
        "take_off",
        action.TakeOff,
        lambda uav, goal: uav.take_off(goal.height, force=goal.force),
        can_be_cancelled=False,
    ),
    Action("land", action.Land, lambda uav, _: uav.land(), can_be_cancelled=False),
    Action(
        "go_to_waypoint",
        action.GoToWaypoint,
        lambda uav, goal: uav.go_to_waypoint(
            values.pose_stamped(goal.waypoint), max_speed_m_s=values.speed(goal.max_speed)
        ),
        _of_waypoint,
    ),
    Action("go_to_waypoint_geo", action.GoToWaypointGeo, _fly_to_geo),
    Action("follow_path", action.FollowPath, _follow_path, _of_path),
    Action(
        "return_to_launch",
        action.ReturnToLaunch,
        lambda uav, goal: uav.return_to_launch(values.height(goal.height)),
    ),
)
