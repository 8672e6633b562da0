"""The commands that fly, and those that ask about a flight: what the contract has, and what only ROS has."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from std_srvs.srv import Empty, Trigger
from ual_msgs import srv

import ual
from ual_ros2 import paths, routes, values
from ual_ros2.command import ActionCommand, Flyer, RosCommand, Serves, Service
from ual_ros2.derived.calls import CALLS, FLIGHTS
from ual_ros2.derived.services import FLYING, TASKS
from ual_ros2.derived.values import plan_fields, task_fields
from ual_ros2.messages import Message
from ual_ros2.services.fields import Fields
from ual_ros2.services.filling import Filling

_FILLING = Filling()


async def _set_pose(uav: ual.aio.Uav, request: Message) -> Fields:
    """Asks before it gives: what topics stream is answered later, and this caller wants its own answer."""
    pose = values.pose_stamped(request.pose)
    await uav.dry_run.set_pose(pose)
    if not request.dry_run:
        await uav.set_pose(pose)
    return {}


async def _set_velocity(uav: ual.aio.Uav, request: Message) -> Fields:
    velocity = values.twist_stamped(request.velocity)
    await uav.dry_run.set_velocity(velocity)
    if not request.dry_run:
        await uav.set_velocity(velocity)
    return {}


async def _take_control(uav: ual.aio.Uav, request: Message) -> Fields:
    flyer: Flyer = uav.dry_run if request.dry_run else uav
    await flyer.recover_from_manual(force=request.force)
    return {}


async def _get_task(uav: ual.aio.Uav, request: Message) -> Fields:
    return {"task": task_fields(await (await uav.task(request.task_id)).info())}


async def _cancel_task(uav: ual.aio.Uav, request: Message) -> None:
    await (await uav.task(request.task_id)).cancel()


async def _pause_task(uav: ual.aio.Uav, request: Message) -> None:
    await (await uav.task(request.task_id)).pause()


async def _resume_task(uav: ual.aio.Uav, request: Message) -> None:
    await (await uav.task(request.task_id)).resume()


async def _get_route(uav: ual.aio.Uav, _: Message) -> Fields:
    route = await uav.route()
    told = {"is_flown": route is not None, "route": await routes.path(route)}
    return told if route is None else {**told, "task_id": route.task_id, "is_goal_moving": route.is_goal_moving}


def _of_pose(request: Message) -> Iterable[Message]:
    return (request.pose.header.stamp,)


def _of_transform(request: Message) -> Iterable[Message]:
    return (request.transform.header.stamp,)


_CALLS: Mapping[str, Serves] = {
    **CALLS,
    "get_route": _get_route,
    "get_task": _get_task,
    "set_pose": _set_pose,
    "set_velocity": _set_velocity,
    "take_control": _take_control,
}
_MORE: Mapping[str, Mapping[str, Any]] = {
    "add_frame": {"stamps": _of_transform, "changes_frames": True},
    "remove_frame": {"changes_frames": True},
    "set_external_pose": {"stamps": _of_pose},
}
"""Tasks of the node in addition to the call."""
SERVICES = (
    *(_FILLING.command(each, _CALLS[each.name], **_MORE.get(each.name, {})) for each in FLYING),
    RosCommand("recover_from_manual", Empty, lambda uav, _: uav.recover_from_manual()),
    RosCommand("recover", Trigger, lambda uav, _: uav.recover_from_manual(), method="RecoverFromManual"),
    RosCommand("cancel_task", srv.OrderTask, _cancel_task, method="Abort"),
    RosCommand("pause_task", srv.OrderTask, _pause_task, method="Pause"),
    RosCommand("resume_task", srv.OrderTask, _resume_task, method="Resume"),
)
_ENDS_BY_PILOT = ("take_off", "land")
"""Take-offs and landings are not cancelled where there is a safety pilot."""


def _action(task: Service) -> ActionCommand:
    """Returns the action of a motion, which may only be asked what it would be."""
    fly = FLIGHTS[task.name]

    async def fly_or_ask(uav: ual.aio.Uav, goal: Message) -> Fields:
        ended: Any = await fly(uav.dry_run if goal.dry_run else uav, goal)
        return {"plan": plan_fields(ended)} if isinstance(ended, ual.types.Plan) else {"task_id": ended.id}

    return ActionCommand(
        task.name,
        task.kind,
        fly_or_ask,
        paths.frames if task.name == "follow_path" else task.frames_of,
        _FILLING.to_messages(task.kind.Result),
        can_be_cancelled=task.name not in _ENDS_BY_PILOT,
    )


ACTIONS = tuple(map(_action, TASKS))
