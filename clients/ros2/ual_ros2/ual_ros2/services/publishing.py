"""Topics that tell of what is beside flying: each is asked for while it is heard, and only then."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from ual_msgs import msg

import ual
from ual.shared.ages import without_seconds
from ual_ros2 import topics
from ual_ros2.derived.values import mission_progress_fields
from ual_ros2.messages import Entity, Message
from ual_ros2.ros_time import RosTime
from ual_ros2.services import cameras, corrections, equipment, gimbals
from ual_ros2.services.corrections import CorrectionsRelay
from ual_ros2.services.fields import Fields
from ual_ros2.services.filling import Filling

_log = logging.getLogger(__name__)


async def _nothing(_: ual.aio.Uav) -> None:
    """Begins nothing."""


@dataclass(frozen=True)
class UavTopic:
    """Messages of a topic, one after the other."""

    name: str
    kind: Entity
    ask: Callable[[ual.aio.Uav], Awaitable[list[Fields]]]
    is_stamped_now: bool = True
    """Whether its header has the time at which it was asked for."""
    begin: Callable[[ual.aio.Uav], Awaitable[None]] = _nothing
    """Called when it is heard anew."""


def topics_of(corrections_in: CorrectionsRelay) -> tuple[UavTopic, ...]:
    """Returns the topics of one UAV."""
    photos = cameras.Photos()

    async def devices(uav: ual.aio.Uav) -> list[Fields]:
        return [{"devices": list(equipment.devices(await uav.gripper.get_all()))}]

    async def mission(uav: ual.aio.Uav) -> list[Fields]:
        return [mission_progress_fields(await uav.mission.progress())]

    async def status(uav: ual.aio.Uav) -> list[Fields]:
        return [await corrections.get_status(uav, corrections_in)]

    return (
        UavTopic("gimbals", msg.GimbalStatus, gimbals.get_statuses, is_stamped_now=False),
        UavTopic("photos", msg.Photo, photos.get_new, is_stamped_now=False, begin=photos.begin),
        UavTopic("equipment", msg.Equipment, devices),
        UavTopic("mission", msg.MissionProgress, mission),
        UavTopic("corrections_status", msg.CorrectionsStatus, status),
    )


class TopicPublisher:
    """Publishes one topic of one UAV."""

    def __init__(self, node: Entity, uav: ual.aio.Uav, ns: str, time: RosTime, topic: UavTopic) -> None:
        self._uav = uav
        self._ns = ns
        self._time = time
        self._filling = Filling(time)
        self._topic = topic
        self._trouble = ""
        self._node = node
        name = f"/{ns}/ual/{topic.name}"
        self._publisher = node.create_publisher(topic.kind, name, **topics.overridable(topics.RELIABLE))

    def destroy(self) -> None:
        """Ends the topic."""
        self._node.destroy_publisher(self._publisher)

    async def follow(self, period_s: float) -> None:
        """Publishes for ever, while it is heard."""
        was_heard = False
        while True:
            is_heard = topics.has_subscribers(self._publisher)
            if is_heard:
                was_heard = await self._tell(was_heard)
            was_heard = was_heard and is_heard
            await asyncio.sleep(period_s)

    async def _tell(self, was_heard: bool) -> bool:
        """Returns whether it told something, so that the next time goes on from there."""
        try:
            if not was_heard:
                await self._topic.begin(self._uav)
            for fields in await self._topic.ask(self._uav):
                self._publisher.publish(self._made(fields))
        except ual.UalError as error:
            self._note(error)
            return was_heard
        self._trouble = ""
        return True

    def _made(self, fields: Fields) -> Message:
        message = self._filling.filled(self._topic.kind(), fields)
        if self._topic.is_stamped_now:
            self._time.stamp_now(message.header.stamp)
        return message

    def _note(self, error: ual.UalError) -> None:
        """Says once why nothing comes."""
        text = f"{error.reason}: {error.message}"
        if without_seconds(text) != self._trouble:
            _log.warning("%s: nothing is told on %s: %s", self._ns, self._topic.name, text)
        self._trouble = without_seconds(text)
