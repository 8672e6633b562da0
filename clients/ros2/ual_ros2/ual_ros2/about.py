"""Topics of one UAV beside its motion. What changes seldom is asked for while it is heard, and told at each change."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from nav_msgs.msg import Path
from ual_msgs.msg import Geofence, GeoPosition, Info, Lease, Refusal

import ual
from ual.shared.waiting import ends_within
from ual_ros2 import routes, topics
from ual_ros2.derived.values import geo_position_fields, geofence_fields, info_fields, lease_fields
from ual_ros2.messages import Entity, Message
from ual_ros2.refusals import Refusals
from ual_ros2.ros_time import RosTime
from ual_ros2.services.fields import Fields, Stamp, key_values
from ual_ros2.services.filling import Filling

LOOK_S = 1.0
"""Seconds between two questions to the daemon for subscribed data. The way is asked for at each new task, too."""


class About:
    """Info of a UAV, its fence, its lease, its route, its position on Earth, and its refused setpoints.

    Only the event loop calls it.
    """

    def __init__(self, node: Entity, loop: asyncio.AbstractEventLoop, uav: ual.aio.Uav, ns: str, time: RosTime) -> None:
        self._node = node
        self._ns = ns
        self._time = time
        self._filling = Filling(time)
        self._uav = uav
        self._refused = self._publisher(Refusal, "refusals", topics.RELIABLE)
        self._asked = [
            _LatchedTopic(self._publisher(Info, "info"), uav.info, self._info),
            _LatchedTopic(self._publisher(Geofence, "geofence"), self._ask_geofence, self._geofence),
            _LatchedTopic(self._publisher(Lease, "lease"), uav.lease_info, self._lease),
        ]
        self._route = _LatchedTopic(self._publisher(Path, "route"), uav.route, self._path)
        self._position = self._publisher(GeoPosition, "position_geo", topics.SENSOR_DATA)
        self._task_id = ""
        self._has_changed = asyncio.Event()
        self._refusals = Refusals(loop, self._tell_refusal)

    def destroy(self) -> None:
        """Ends the topics."""
        asked = (each.publisher for each in self._asked)
        for publisher in (self._refused, self._position, self._route.publisher, *asked):
            self._node.destroy_publisher(publisher)

    def refuse(self, topic: str, error: ual.UalError) -> None:
        """Tells that a setpoint of a topic was refused."""
        self._refusals.note(topic, error)

    def note(self, task: ual.TaskInfo | None) -> None:
        """Takes the running task of a sample: another one has another way."""
        task_id = "" if task is None else task.id
        if task_id != self._task_id:
            self._task_id = task_id
            self._has_changed.set()

    def publish_slow(self, sample: ual.Telemetry) -> None:
        """Publishes where it is on Earth."""
        if sample.position_geo is not None and topics.has_subscribers(self._position):
            header = {"frame_id": f"{self._ns}/base_link", "stamp": Stamp(sample.stamp_s)}
            fields = {"header": header, **geo_position_fields(sample)}
            self._position.publish(self._filling.filled(GeoPosition(), fields))

    async def follow(self) -> None:
        """Publishes for ever what has changed."""
        while True:
            for each in self._asked:
                if not await each.poll():
                    each.told = None  # who listens next hears what holds then
            await asyncio.sleep(LOOK_S)

    async def follow_route(self) -> None:
        """Publishes the way for ever."""
        while True:
            self._has_changed.clear()
            await self._poll_route()
            await ends_within(self._has_changed.wait(), LOOK_S)

    def end(self) -> None:
        """Tells no more; no way that was flown stays on the topic."""
        self._refusals.end()
        self._clear_route()

    async def _poll_route(self) -> None:
        if not await self._route.poll():
            self._clear_route()

    def _clear_route(self) -> None:
        """A topic that keeps its last message must not give a later listener the way of a task that has ended."""
        told, self._route.told = self._route.told, None
        if told not in (None, (None,)):
            self._route.publisher.publish(self._stamped(Path()))

    async def _ask_geofence(self) -> ual.types.Geofence | str:
        """Returns the geofence; or why it is not known."""
        try:
            return await self._uav.geofence()
        except ual.WrongStateError as error:  # FRAME_LOST, too
            return error.message

    def _publisher(self, kind: Entity, name: str, qos: Entity = topics.LATCHED) -> Entity:
        topic = f"/{self._ns}/ual/{name}"
        return self._node.create_publisher(kind, topic, **topics.overridable(qos))

    async def _info(self, info: ual.Info) -> Message:
        return self._filled(Info(), info_fields(info))

    async def _geofence(self, geofence: ual.types.Geofence | str) -> Message:
        if isinstance(geofence, str):
            return self._filled(Geofence(), {"unknown": geofence})
        return self._filled(Geofence(), {"header": {"frame_id": geofence.frame_id}, **geofence_fields(geofence)})

    async def _lease(self, lease: ual.types.LeaseInfo | None) -> Message:
        return self._filled(Lease(), {} if lease is None else {"is_held": True, **lease_fields(lease)})

    async def _path(self, route: ual.types.Route | None) -> Message:
        return self._stamped(await routes.path(route))

    def _tell_refusal(self, topic: str, error: ual.UalError, count: int) -> None:
        if topics.has_subscribers(self._refused):
            words = {"reason": error.reason, "message": error.message, "metadata": key_values(error.metadata)}
            self._refused.publish(self._filled(Refusal(), {"topic": topic, **words, "count": count}))

    def _filled(self, message: Message, fields: Fields) -> Message:
        return self._stamped(self._filling.filled(message, fields))

    def _stamped(self, message: Message) -> Message:
        self._time.stamp_now(message.header.stamp)
        return message


class _LatchedTopic:
    """A topic that keeps its last message, and what it has told."""

    def __init__(
        self, publisher: Entity, ask: Callable[[], Awaitable[object]], make: Callable[[Any], Awaitable[Message]]
    ) -> None:
        self.publisher = publisher
        self._ask = ask
        self._make = make
        self.told: object = None
        """In a tuple, as what is told may be None. None: nothing, since it is heard."""

    async def poll(self) -> bool:
        """Publishes what has changed since it was told. What is not heard is not asked for.

        Returns False where it is not heard, or not known.
        """
        if not topics.has_subscribers(self.publisher):
            return False
        try:
            asked = (await self._ask(),)
        except ual.UalError:  # mostly the daemon is not there, which `state` tells
            return False
        if asked != self.told:
            self.publisher.publish(await self._make(asked[0]))
            self.told = asked
        return True
