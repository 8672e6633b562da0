"""Missions of the autopilot in ROS. It needs no ROS: requests are known by their fields."""

from __future__ import annotations

import asyncio
from contextlib import suppress

import ual
from ual import missions
from ual.missions import LinkLossAction, Mission, MissionProgress
from ual.routes import RouteError
from ual.types import TaskInfo
from ual_ros2 import values
from ual_ros2.derived.values import mission_item_fields, mission_progress_fields, read_mission_item
from ual_ros2.messages import Message
from ual_ros2.services.fields import Fields, named, read_all


async def plan(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves PlanMission."""
    mission = await _mission(request)
    found = await uav.mission.plan(mission.items)
    return {
        "length": values.known(found.length_m),
        "duration": found.duration_s,
        "lowest": found.lowest_m,
        "highest": found.highest_m,
        "executed_count": found.executed_count,
        "left_out": list(mission.left_out),
    }


async def upload(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves UploadMission."""
    mission = await _mission(request)
    stored = await uav.mission.upload(mission.items)
    items = [mission_item_fields(each) for each in stored.items]
    return {"items": items, "digest": stored.digest, "left_out": list(mission.left_out)}


class MissionFlights:
    """Flies missions of one UAV, and knows how far that which flies is."""

    def __init__(self) -> None:
        self._progress: MissionProgress | None = None

    async def fly(self, uav: ual.aio.Uav, request: Message) -> Fields:
        """Serves FlyMission: flies what the autopilot has to its end. A cancel ends the mission, and the UAV holds."""
        begun = asyncio.ensure_future(_start(uav, request))
        watching = asyncio.ensure_future(self._watch(uav))
        try:
            task = await uav.task((await asyncio.shield(begun)).id)
            await task.wait()
        except asyncio.CancelledError:
            await asyncio.shield(_end(uav, begun))  # the node may end while it ends the mission
            raise
        else:
            return {"task_id": task.id}
        finally:
            watching.cancel()

    async def serve(self, uav: ual.aio.Uav, request: Message) -> Fields:
        """Serves FlyMission, which may answer when it has begun: then it goes on, whatever becomes of the node."""
        if request.blocking:
            return await self.fly(uav, request)
        return {"task_id": (await _start(uav, request)).id}

    def progress_of(self, task_id: str) -> Fields | None:
        """Returns what the feedback of a flight has beside the task; None while that is not known.

        How far a mission before it came is none of it.
        """
        if self._progress is None or self._progress.task_id != task_id:
            return None
        return {"mission": mission_progress_fields(self._progress)}

    async def _watch(self, uav: ual.aio.Uav) -> None:
        with suppress(ual.UalError):  # the flight itself tells what is wrong
            async for progress in uav.mission.watch():
                self._progress = progress


async def _start(uav: ual.aio.Uav, request: Message) -> TaskInfo:
    on_link_loss = named(LinkLossAction, request.on_link_loss, "on_link_loss") if request.on_link_loss else None
    return await uav.mission.start(request.first_item or 1, on_link_loss)


async def _end(uav: ual.aio.Uav, begun: asyncio.Future[TaskInfo]) -> None:
    """Ends a mission, also one whose start is under way: that is refused after an abort, or else ended once it flies.

    Raises:
        UalError: It flies on.

    """
    if not begun.done():
        with suppress(ual.UalError):
            await uav.abort()
    try:
        info = await begun
    except ual.UalError:
        return
    await (await uav.task(info.id)).cancel()


async def _mission(request: Message) -> Mission:
    """Reads the mission of a request.

    Raises:
        InvalidArgumentError: It is said in two ways, or the file or an item is none.

    """
    if not request.file:
        return Mission(list(read_all(read_mission_item, request.items, "items")))
    if request.items:
        raise ual.InvalidArgumentError("file: give a file or items, not both", {"field": "file"})
    reference = values.altitude_reference(request.altitude_reference) if request.altitude_reference else None
    altitude_m = request.altitude or None
    try:
        return await asyncio.to_thread(_parsed, request.file, altitude_m, reference)
    except RouteError as error:
        raise ual.InvalidArgumentError(str(error), {"field": "file"}) from None


def _parsed(text: str, altitude_m: float | None, reference: ual.AltitudeReference | None) -> Mission:
    return missions.parse(text.encode(), "file", altitude_m=altitude_m, altitude_reference=reference)
