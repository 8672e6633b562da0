"""Telemetry of a UAV in ROS, put together: samples from the topics, and the frames of tf."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from derived_values import read_geo_position
from flying import LATCHED, LIMIT_S, Client
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from tf2_msgs.msg import TFMessage
from ual_msgs.msg import GeoPosition, State

import ual
from ual_ros2 import values

NUMBERED = {number: state for state, number in values.STATE_NUMBERS.items()}
ALL = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
RELIABLE = QoSProfile(depth=100)
STATES = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Each state counts, also one that is short."""
PARTS = {"pose", "velocity", "odom", "body"}
NEAR_M = 1e-9
REFERENCE_S = 0.5
"""A reference pose that is older than this, beside the sample, is not there any more."""


class ReportedSample:
    """Samples: the messages of one stamp, with the state that was told last."""

    def __init__(self, client: Client, ns: str) -> None:
        self._body = f"{ns}/base_link"
        self._changed = threading.Condition()
        self._callbacks: list[Callable[[ual.Telemetry], None]] = []
        self._parts: dict[float, dict[str, Any]] = {}
        self._links: dict[str, tuple[ual.Transform, bool]] = {}
        self._state: Any = None
        self._fix: Any = None
        self._reference: Any = None
        self._newest: ual.Telemetry | None = None
        hear, ual_ = client.node.create_subscription, f"/{ns}/ual"
        hear(State, f"{ual_}/state", lambda message: self._note("_state", message), STATES)
        hear(PoseStamped, f"{ual_}/ref_pose", lambda message: self._note("_reference", message), ALL)
        hear(GeoPosition, f"{ual_}/position_geo", lambda message: self._note("_fix", message), ALL)
        hear(TFMessage, "/tf_static", lambda message: self._on_tf(message, True), LATCHED)
        hear(TFMessage, "/tf", lambda message: self._on_tf(message, False), RELIABLE)
        for name, kind in (("pose", PoseStamped), ("velocity", TwistStamped), ("odom", Odometry)):
            hear(kind, f"{ual_}/{name}", lambda message, name=name: self._on_part(name, message), ALL)

    def sample(self, since_s: float) -> ual.Telemetry:
        """Returns a sample later than a time of the vehicle, however many earlier ones a busy computer still has.

        Raises:
            LinkLostError: None comes.

        """
        with self._changed:
            came = self._changed.wait_for(lambda: self._newest is not None and self._newest.stamp_s > since_s, LIMIT_S)
            if not came or self._newest is None:
                raise ual.LinkLostError(f"nothing is told for {LIMIT_S:g} s")
            return self._newest

    def begin(self, callback: Callable[[ual.Telemetry], None]) -> None:
        """Calls back with each sample from now on, until `end`."""
        with self._changed:
            self._callbacks.append(callback)

    def wait_for_frame(self, link: ual.Transform) -> None:
        """Waits until tf tells where a frame lies, as every program in ROS that has added one."""

        def is_there() -> bool:
            told = self._links.get(link.child_frame_id)
            return told is not None and (told[0].translation - link.translation).norm() < NEAR_M

        with self._changed:
            assert self._changed.wait_for(is_there, LIMIT_S), f"tf does not tell the frame {link.child_frame_id}"

    def end(self, callback: Callable[[ual.Telemetry], None]) -> None:
        """Ends calling back."""
        with self._changed:
            self._callbacks.remove(callback)

    def transform(self, target: str, source: str) -> ual.Transform:
        """Returns what takes coordinates from one frame of tf to another.

        Raises:
            UnknownFrameError: tf does not lead from one to the other.

        """
        with self._changed:
            from_target, from_source = self._upwards(target), self._upwards(source)
        for frame_id, up in from_source.items():
            if frame_id in from_target:
                return from_target[frame_id].inverse().compose(up)
        raise ual.UnknownFrameError(f"tf does not lead from {source} to {target}")

    def _upwards(self, frame_id: str) -> dict[str, ual.Transform]:
        """The transforms from a frame to itself and to each one above it; none where tf does not know it."""
        if frame_id not in self._links and all(frame_id != link.frame_id for link, _ in self._links.values()):
            return {}
        way = {frame_id: ual.Transform(frame_id=frame_id, child_frame_id=frame_id)}
        above = frame_id
        while above in self._links:
            link, below = self._links[above][0], way[above]
            above = link.frame_id
            way[above] = link.compose(below)
        return way

    # --- On the executor ----------------------------------------------------------------------------------------------

    def _note(self, name: str, message: Any) -> None:
        with self._changed:
            setattr(self, name, message)

    def _on_tf(self, message: Any, is_static: bool) -> None:
        with self._changed:
            for each in message.transforms:
                link = values.transform_stamped(each, values.stamp_s(each.header.stamp))
                self._links[link.child_frame_id] = link, is_static
                self._changed.notify_all()
                if link.child_frame_id == self._body:
                    self._put("body", link.stamp_s, link)

    def _on_part(self, name: str, message: Any) -> None:
        with self._changed:
            self._put(name, _stamp_s(message), message)

    def _put(self, name: str, stamp_s: float, part: Any) -> None:
        parts = self._parts.setdefault(stamp_s, {})
        parts[name] = part
        if parts.keys() == PARTS and self._state is not None:
            self._parts = {other_s: others for other_s, others in self._parts.items() if other_s > stamp_s}
            self._tell(stamp_s, **parts)

    def _tell(self, stamp_s: float, pose: Any, velocity: Any, odom: Any, body: ual.Transform) -> None:
        told = self._state
        self._newest = ual.Telemetry(
            state=NUMBERED[told.state],
            state_reason=told.reason,
            stamp_s=stamp_s,
            frame_id=pose.header.frame_id,
            pose=values.pose(pose.pose),
            velocity=values.twist(velocity.twist),
            odometry=ual.Odometry(
                values.pose(odom.pose.pose),
                values.twist(odom.twist.twist),
                odom.header.frame_id,
                odom.child_frame_id,
                stamp_s,
            ),
            transform=self._in_map(body),
            reference_pose=self._reference_at(stamp_s),
            position_geo=None if self._fix is None else read_geo_position(self._fix)["position_geo"],
            flight_mode=told.flight_mode,
            armed=told.armed,
            task=_task(told),
            sequence=1 if self._newest is None else self._newest.sequence + 1,
            frame_lost=told.frame_lost,
        )
        self._changed.notify_all()
        for callback in tuple(self._callbacks):
            callback(self._newest)

    def _in_map(self, body: ual.Transform) -> ual.Transform | None:
        to_map = self._upwards(body.frame_id).get("map")
        return None if to_map is None else replace(to_map.compose(body), stamp_s=body.stamp_s)

    def _reference_at(self, stamp_s: float) -> ual.Pose | None:
        reference = self._reference
        if reference is None or stamp_s - _stamp_s(reference) > REFERENCE_S:
            return None
        return values.pose(reference.pose)


def _stamp_s(message: Any) -> float:
    return values.stamp_s(message.header.stamp)


def _task(told: Any) -> ual.TaskInfo | None:
    """The state tells which task it is; how far it is, the feedback and `get_task` do."""
    if not told.task:
        return None
    return ual.TaskInfo(told.task_id, ual.TaskKind[told.task], ual.TaskStatus.RUNNING, is_paused=told.is_paused)
