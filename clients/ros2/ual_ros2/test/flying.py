"""A program in ROS that calls, flies, publishes and hears; and waiting for what comes."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import rclpy
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped, TransformStamped, TwistStamped
from rclpy.action import ActionClient
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from tf2_msgs.msg import TFMessage

LIMIT_S = 90.0
"""Seconds of the longest wait: a busy machine needs it."""
AGAIN_S = 5.0
"""Seconds without an answer after which a request that may come twice is sent again."""
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
SENSOR = qos_profile_sensor_data
SUCCEEDED, CANCELED, ABORTED = GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_CANCELED, GoalStatus.STATUS_ABORTED


def waited(condition: Callable[[], Any], limit_s: float = LIMIT_S) -> Any:
    """Waits until a condition holds, and returns what it returned."""
    deadline_s = time.monotonic() + limit_s
    while not (found := condition()):
        assert time.monotonic() < deadline_s, "it did not come"
        time.sleep(0.01)
    return found


def each_of(heard: list[Any]) -> Iterator[Any]:
    """Yields what has come, and what comes later."""
    for count in itertools.count():
        waited(partial(_has, heard, count))
        yield heard[count]


def _has(heard: list[Any], count: int) -> bool:
    return len(heard) > count


def pose(x: float, y: float, z: float, frame_id: str = "") -> PoseStamped:
    """A pose that keeps the heading."""
    message = PoseStamped()
    message.header.frame_id = frame_id
    message.pose.position.x, message.pose.position.y, message.pose.position.z = x, y, z
    message.pose.orientation.w = 0.0
    return message


def velocity(x: float, frame_id: str = "") -> TwistStamped:
    message = TwistStamped()
    message.header.frame_id = frame_id
    message.twist.linear.x = x
    return message


def current_position(x: float, frame_id: str, child_frame_id: str) -> TFMessage:
    """A transform along x."""
    link = TransformStamped()
    link.header.frame_id, link.child_frame_id = frame_id, child_frame_id
    link.transform.translation.x = x
    return TFMessage(transforms=[link])


class Client:
    """A node with a thread of its own."""

    def __init__(self) -> None:
        self.node = rclpy.create_node("client")
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._clients: dict[str, Any] = {}
        self._publishers: dict[str, Any] = {}
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Ends it."""
        self._executor.shutdown()
        self._thread.join()

    def call(self, kind: Any, name: str, /, **fields: Any) -> Any:
        """Calls a service and returns its response."""
        return self._result(self.call_soon(kind, name, **fields))

    def call_again(self, kind: Any, name: str, /, **fields: Any) -> Any:
        """Calls a service that may be called twice, again while it does not answer, and returns its first response.

        A killed node is still seen for a while. A request that leaves before its successor is found is lost.
        """
        begun: list[Any] = []

        def response() -> Any:
            if not begun or time.monotonic() - begun[-1][0] > AGAIN_S:
                begun.append((time.monotonic(), self.call_soon(kind, name, **fields)))
            return next((future for _, future in begun if future.done()), None)

        return waited(response).result()

    def call_soon(self, kind: Any, name: str, /, **fields: Any) -> Any:
        """Calls a service and returns the future of its response."""
        client = self._client(kind, name)
        return self._on_executor(lambda: client.call_async(kind.Request(**fields)))

    def fly(self, kind: Any, name: str, **fields: Any) -> tuple[int, Any]:
        """Flies an action to its end; returns its status and result."""
        return self.end_of(self.begin(kind, name, lambda _: None, **fields))

    def begin(self, kind: Any, name: str, on_feedback: Callable[[Any], object], **fields: Any) -> Any:
        """Begins an action, and returns the handle of its goal."""
        if f"{name} action" not in self._clients:
            self._clients[f"{name} action"] = ActionClient(self.node, kind, name)
        action = self._clients[f"{name} action"]
        assert action.wait_for_server(LIMIT_S)
        return self._result(
            self._on_executor(
                lambda: action.send_goal_async(
                    kind.Goal(**fields), feedback_callback=lambda told: on_feedback(told.feedback)
                )
            )
        )

    def end_of(self, goal: Any) -> tuple[int, Any]:
        """Waits for the end of a goal; returns its status and result."""
        ended = self._result(self.end_soon(goal))
        return ended.status, ended.result

    def end_soon(self, goal: Any) -> Any:
        """Asks for the end of a goal; returns the future of it."""
        return self._on_executor(goal.get_result_async)

    def cancel(self, goal: Any) -> bool:
        """Cancels a goal; returns whether that is accepted."""
        return bool(self._result(self._on_executor(goal.cancel_goal_async)).goals_canceling)

    def hear(self, kind: Any, topic: str, qos: Any = SENSOR) -> list[Any]:
        """Returns a list of what comes on a topic, which grows."""
        heard: list[Any] = []
        self.node.create_subscription(kind, topic, heard.append, qos)
        return heard

    def publish(self, kind: Any, topic: str, message: Any, qos: Any = SENSOR) -> None:
        """Publishes a message on a topic that is listened to."""
        self.publisher(kind, topic, qos).publish(message)

    def publisher(self, kind: Any, topic: str, qos: Any = SENSOR) -> Any:
        """Returns the publisher of a topic, once that is listened to."""
        if topic not in self._publishers:
            publisher = self._publishers[topic] = self.node.create_publisher(kind, topic, qos)
            waited(publisher.get_subscription_count)
        return self._publishers[topic]

    def repeat(self, period_s: float, kind: Any, topic: str, message: Callable[[], Any]) -> Any:
        """Publishes again and again; returns the timer."""
        publisher = self.node.create_publisher(kind, topic, 10)
        return self.node.create_timer(period_s, lambda: publisher.publish(message()))

    def _client(self, kind: Any, name: str) -> Any:
        if name not in self._clients:
            self._clients[name] = self.node.create_client(kind, name)
        assert self._clients[name].wait_for_service(LIMIT_S)
        return self._clients[name]

    def _on_executor(self, begin: Callable[[], Any]) -> Any:
        """Begins a call where its answer is read: rclpy loses one that comes before the call is noted."""
        return self._result(self._executor.create_task(begin))

    def _result(self, future: Any) -> Any:
        waited(future.done)
        return future.result()

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            pass
