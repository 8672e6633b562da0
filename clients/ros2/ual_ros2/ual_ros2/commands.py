"""The commands: which service or action each is, and which member of the client it calls with what."""

from __future__ import annotations

from collections.abc import Awaitable, Mapping

from ual_msgs import msg, srv

import ual
from ual.parameters.values import Parameter
from ual_ros2 import flights, payload, values
from ual_ros2.command import Command
from ual_ros2.messages import Message


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


def _start_photos(uav: ual.aio.Uav, request: Message) -> Awaitable[object]:
    interval_s, distance_m = request.interval or None, request.distance or None
    return uav.cameras[request.camera].start_photos(interval_s=interval_s, distance_m=distance_m, count=request.count)


def _order_winch(uav: ual.aio.Uav, request: Message) -> Awaitable[object]:
    chosen, length_m, rate_m_s = payload.winch_order(request)
    return uav.gripper.order_winch(chosen, winch=request.winch, length_m=length_m, rate_m_s=rate_m_s)


SERVICES = (
    *flights.SERVICES,
    Command(
        "get_parameter",
        srv.GetParameter,
        lambda uav, request: uav.parameters.get(request.name),
        told=_told_parameter,
        needs_lease=False,
    ),
    Command(
        "list_parameters",
        srv.ListParameters,
        lambda uav, _: uav.parameters.get_all(),
        told=_told_parameters,
        needs_lease=False,
    ),
    Command(
        "set_parameter",
        srv.SetParameter,
        lambda uav, request: uav.parameters.set(request.name, request.value, force=request.force),
        told=_told_parameter,
    ),
    Command("start_photos", srv.StartPhotos, _start_photos, needs_lease=False),
    *(
        Command(name, srv.OrderCamera, order, needs_lease=False)
        for name, order in (
            ("stop_photos", lambda uav, request: uav.cameras[request.camera].stop_photos()),
            ("start_video", lambda uav, request: uav.cameras[request.camera].start_video()),
            ("stop_video", lambda uav, request: uav.cameras[request.camera].stop_video()),
        )
    ),
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
)

ACTIONS = flights.ACTIONS
