"""Frames both ways: those of the daemons in tf, and those that only tf knows in the daemons."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterable
from functools import partial

from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

import ual
from ual_ros2 import topics, values
from ual_ros2.listener import TopicListener
from ual_ros2.messages import Entity, Message
from ual_ros2.ros_time import RosTime
from ual_ros2.tf_buffer import FoundTransform, TfBuffer

_log = logging.getLogger(__name__)

FEED_S = 0.05
"""Seconds between two updates of a frame of tf to a daemon, while the frame moves."""
COMPLETE_S = 1.0
"""Seconds from the begin of listening within which tf may send its frames: commands in them wait meanwhile."""
APPEARS_S = 0.3
"""Seconds for which a command waits in any case for a frame that is not known yet: its publisher may be new."""


class Tf:
    """``/tf`` and ``/tf_static``, shared by all UAVs of the node. Only the event loop publishes.

    Args:
        node: Has the topics.
        time: The node's clock.
        listener: Hears them.
        tolerance_s: How long after a frame was on ``/tf`` goals may be in it.

    """

    def __init__(self, node: Entity, time: RosTime, listener: TopicListener, tolerance_s: float) -> None:
        self.moving = node.create_publisher(TFMessage, "/tf", **topics.overridable(topics.TF))
        self._static = node.create_publisher(TFMessage, "/tf_static", **topics.overridable(topics.LATCHED))
        self._node = node
        self._time = time
        self._listener = listener
        self._tolerance_s = tolerance_s
        self._published: dict[str, ual.Transform] = {}
        self._listened: TfBuffer | None = None
        self._complete_s = 0.0
        self._subscriptions: list[Entity] = []

    def destroy(self) -> None:
        """Ends both topics."""
        for publisher in (self.moving, self._static):
            self._node.destroy_publisher(publisher)
        for subscription in self._subscriptions:
            self._listener.unsubscribe(subscription)

    def publish_static(self, links: Iterable[ual.Transform], gone: Iterable[str] = ()) -> None:
        """Publishes what has changed. A late listener gets one message: so all of them are in each.

        Those that are gone are forgotten: this node hears itself, and a goal in one of them is to be refused.
        """
        before = dict(self._published)
        for frame_id in gone:
            self._published.pop(frame_id, None)
            if self._listened is not None:
                self._listened.forget(frame_id)
        self._published.update((link.child_frame_id, link) for link in links)
        if self._published != before:
            self._static.publish(TFMessage(transforms=[self._stamped(link) for link in self._published.values()]))

    def publish_moving(self, links: Iterable[ual.Transform], stamp_s: float | None = None) -> None:
        """Publishes where frames are at a time, or now."""
        if stamped := [self._stamped(link, stamp_s) for link in links]:
            self.moving.publish(TFMessage(transforms=stamped))

    def listened(self) -> TfBuffer:
        """Returns what tf says. It is listened to from the first call on: most programs need it never."""
        if self._listened is None:
            self._listened = TfBuffer(self._tolerance_s)
            self._complete_s = asyncio.get_running_loop().time() + COMPLETE_S
            for topic, is_static, qos in (("/tf", False, topics.TF), ("/tf_static", True, topics.MANY_LATCHED)):
                callback = partial(self._on_tf, is_static=is_static)
                self._subscriptions.append(self._listener.subscribe(TFMessage, topic, callback, qos))
        return self._listened

    def complete_s(self) -> float:
        """Returns when a frame that is not known by then is known to be missing, in the event loop's time."""
        return max(self._complete_s, asyncio.get_running_loop().time() + APPEARS_S)

    def _on_tf(self, message: Message, *, is_static: bool) -> None:
        if self._listened is not None:
            for each in message.transforms:
                self._listened.put(values.transform_stamped(each), is_static=is_static)

    def _stamped(self, link: ual.Transform, stamp_s: float | None = None) -> Message:
        message = TransformStamped()
        values.fill_transform(message, link)
        if stamp_s is None:
            self._time.stamp_now(message.header.stamp)
        else:
            self._time.stamp(message.header.stamp, stamp_s)
        return message


class Frames:
    """The frames of one UAV. Only the event loop calls it."""

    def __init__(self, uav: ual.aio.Uav, ns: str, tf: Tf) -> None:
        self._uav = uav
        self._body = f"{ns}/base_link"
        self._tf = tf
        self._known: frozenset[str] = frozenset()
        self._told: frozenset[str] = frozenset()
        """The frames of this daemon that tf has from here."""
        self._given: dict[str, FoundTransform] = {}
        """The frames that this daemon has from tf, as it was told last."""
        self._moving: set[str] = set()
        """Frames among them that have moved."""
        self.has_moving = False
        """Whether the daemon has frames that move, beside the body, and tf is heard: then they are asked for fast."""

    async def publish(self) -> None:
        """Publishes the daemon's frames, but for the body, which each sample tells, and those that tf has anyway."""
        given = set(self._given)
        frames = await self._uav.frames()
        for frame_id in given - {frame.frame_id for frame in frames}:
            self._given.pop(frame_id, None)  # a daemon that was started anew has none of tf's
        self._known = frozenset(frame.frame_id for frame in frames) - self._given.keys() | {"map"}
        told = [frame for frame in frames if frame.transform is not None and frame.frame_id not in self._given]
        links = {frame.frame_id: _link(frame) for frame in told if frame.frame_id != self._body}
        static = [links[frame.frame_id] for frame in told if frame.is_static and frame.frame_id in links]
        moving = [links[frame.frame_id] for frame in told if not frame.is_static and frame.frame_id in links]
        gone, self._told = self._told - links.keys() - self._given.keys(), frozenset(links)
        self._tf.publish_static(static, gone)
        self._tf.publish_moving(moving)
        self.has_moving = bool(moving) and topics.has_subscribers(self._tf.moving)

    async def provide(self, frame_ids: Iterable[str]) -> None:
        """Gives the daemon those of the frames that it does not know and tf does.

        One that neither knows is left to the daemon: its refusal lists the frames that there are.

        Raises:
            FrameLostError: tf tells no more where one is. What follows a goal in it already holds there.

        """
        for frame_id in set(frame_ids) - self._known - {"", self._body}:
            found = await self._appears(frame_id)
            if found is None:
                continue
            self._tf.listened().require_fresh(frame_id, found)
            if frame_id not in self._given:
                await self._give(frame_id, found)

    async def feed(self) -> None:
        """Tells the daemon for ever where the frames of tf are.

        One that has moved is told as often as tf tells it, so that the daemon sees when it stands.
        """
        while True:
            await asyncio.sleep(FEED_S)
            for frame_id, before in list(self._given.items()):
                found = self._tf.listened().to_known(frame_id, self._known)
                if found is None or found.told_count == before.told_count:
                    continue
                if found.link != before.link:
                    self._moving.add(frame_id)
                if frame_id in self._moving:
                    await self._give_again(frame_id, found)

    async def take_back(self) -> None:
        """Removes the frames of tf from the daemon. A UAV that follows a goal in one of them stops."""
        given, self._given = self._given, {}
        for frame_id in given:
            try:
                await self._uav.remove_frame(frame_id)
            except ual.UalError as error:
                _log.warning("the frame %s was not removed: %s", frame_id, error)

    async def _appears(self, frame_id: str) -> FoundTransform | None:
        tf = self._tf.listened()
        until_s = self._tf.complete_s()
        while True:
            found = tf.to_known(frame_id, self._known)
            if found is not None or asyncio.get_running_loop().time() > until_s:
                return found
            await asyncio.sleep(FEED_S)

    async def _give(self, frame_id: str, found: FoundTransform) -> None:
        await self._uav.add_frame(found.link)
        self._given[frame_id] = found

    async def _give_again(self, frame_id: str, found: FoundTransform) -> None:
        try:
            await self._give(frame_id, found)
        except ual.UalError as error:
            _log.warning("the daemon does not take the frame %s any more: %s", frame_id, error)
            self._given.pop(frame_id, None)


def _link(frame: ual.Frame) -> ual.Transform:
    assert frame.transform is not None
    there = frame.transform
    return ual.Transform(there.translation, there.rotation, frame.parent_frame_id, frame.frame_id)
