"""The listener hears topics on a thread of its own, or by the executor where this rclpy lacks what it needs."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import rclpy
from flying import LIMIT_S, waited
from geometry_msgs.msg import Vector3
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from ual_ros2.listener import TopicListener
from ual_ros2.node import UalNode

BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
RELIABLE = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)


@pytest.fixture(scope="module", autouse=True)
def ros() -> Iterator[None]:
    rclpy.init()
    yield
    rclpy.try_shutdown()


@pytest.fixture
def node() -> Iterator[Any]:
    node = rclpy.create_node("listens")
    yield node
    node.destroy_node()


class ReceivedMessage:
    """Received messages, and the thread of each."""

    def __init__(self) -> None:
        self.numbers: list[float] = []
        self.threads: set[str] = set()

    def __call__(self, message: Vector3) -> None:
        self.numbers.append(message.x)
        self.threads.add(threading.current_thread().name)


@contextmanager
def spinning(listener: TopicListener) -> Iterator[threading.Thread]:
    thread = threading.Thread(target=listener.spin, name="own")
    thread.start()
    try:
        yield thread
    finally:
        listener.end()
        thread.join(LIMIT_S)
        assert not thread.is_alive()


def publish_until(publisher: Any, number: float, heard: ReceivedMessage) -> None:
    def is_received() -> bool:
        publisher.publish(Vector3(x=number))
        return number in heard.numbers

    waited(is_received)


def test_it_hears_on_its_own_thread_without_an_executor(node: Any) -> None:
    heard, later = ReceivedMessage(), ReceivedMessage()
    listener = TopicListener(node)
    assert listener.waits_itself
    listener.subscribe(Vector3, "/first", heard, BEST_EFFORT)
    with spinning(listener):
        publish_until(node.create_publisher(Vector3, "/first", BEST_EFFORT), 1.0, heard)
        listener.subscribe(Vector3, "/later", later, BEST_EFFORT)
        publish_until(node.create_publisher(Vector3, "/later", BEST_EFFORT), 2.0, later)
    assert heard.threads == later.threads == {"own"}


def test_the_executor_leaves_the_topics_to_it(node: Any) -> None:
    heard, others = ReceivedMessage(), ReceivedMessage()
    listener = TopicListener(node)
    listener.subscribe(Vector3, "/topic", heard, BEST_EFFORT)
    node.create_subscription(Vector3, "/topic", others, BEST_EFFORT)
    publisher = node.create_publisher(Vector3, "/topic", BEST_EFFORT)
    executor = SingleThreadedExecutor()
    executor.add_node(node)

    def is_received_by_others() -> bool:
        publisher.publish(Vector3(x=1.0))
        executor.spin_once(0.1)
        return bool(others.numbers)

    waited(is_received_by_others)
    assert not heard.numbers
    with spinning(listener):
        publish_until(publisher, 2.0, heard)
    executor.shutdown()


def test_what_is_known_of_a_message_comes_with_it(node: Any) -> None:
    heard = ReceivedMessage()
    stamps_ns: list[int] = []

    def on_message(message: Vector3, info: Any) -> None:
        stamps_ns.append(info["source_timestamp"])
        heard(message)

    listener = TopicListener(node)
    listener.subscribe(Vector3, "/topic", on_message, BEST_EFFORT)
    with spinning(listener):
        publish_until(node.create_publisher(Vector3, "/topic", BEST_EFFORT), 1.0, heard)
    assert stamps_ns[0] > 0


def test_what_is_unsubscribed_is_received_no_more(node: Any) -> None:
    heard, others = ReceivedMessage(), ReceivedMessage()
    listener = TopicListener(node)
    ended = listener.subscribe(Vector3, "/topic", heard, BEST_EFFORT)
    listener.subscribe(Vector3, "/topic", others, BEST_EFFORT)
    publisher = node.create_publisher(Vector3, "/topic", BEST_EFFORT)
    with spinning(listener):
        publish_until(publisher, 1.0, heard)
        listener.unsubscribe(ended)
        publish_until(publisher, 2.0, others)
        publish_until(publisher, 3.0, others)
    assert 3.0 not in heard.numbers


def test_a_publisher_that_does_not_fit_is_reported(node: Any) -> None:
    told: list[Any] = []
    listener = TopicListener(node)
    callbacks = SubscriptionEventCallbacks(incompatible_qos=told.append)
    listener.subscribe(Vector3, "/topic", ReceivedMessage(), RELIABLE, event_callbacks=callbacks)
    with spinning(listener):
        node.create_publisher(Vector3, "/topic", BEST_EFFORT)
        waited(lambda: told)


def test_what_a_callback_raises_ends_it(node: Any) -> None:
    def fail(_: Vector3) -> None:
        raise ZeroDivisionError

    listener = TopicListener(node)
    listener.subscribe(Vector3, "/topic", fail, BEST_EFFORT)
    publisher = node.create_publisher(Vector3, "/topic", BEST_EFFORT)
    timer = threading.Timer(0.0, lambda: waited(lambda: publisher.publish(Vector3()) or failed.is_set()))
    failed = threading.Event()
    timer.start()
    with pytest.raises(ZeroDivisionError):
        listener.spin()
    failed.set()
    timer.join()


@pytest.mark.parametrize("missing", ["WaitSet", "Subscription.take_message"])
def test_the_executor_hears_where_this_rclpy_cannot(node: Any, monkeypatch: pytest.MonkeyPatch, missing: str) -> None:
    heard = ReceivedMessage()
    with monkeypatch.context() as without:
        without.delattr(f"{rclpy_implementation.__name__}.{missing}")
        listener = TopicListener(node)
    assert not listener.waits_itself
    listener.subscribe(Vector3, "/topic", heard, BEST_EFFORT)
    publisher = node.create_publisher(Vector3, "/topic", BEST_EFFORT)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    with spinning(listener):

        def is_received() -> bool:
            publisher.publish(Vector3(x=1.0))
            executor.spin_once(0.1)
            return bool(heard.numbers)

        waited(is_received)
    executor.shutdown()
    assert heard.threads == {threading.current_thread().name}


def test_simulated_time_is_received_without_the_executor_until_it_is_switched_off() -> None:
    loop = asyncio.new_event_loop()
    simulated = [Parameter("use_sim_time", value=True), Parameter("autostart", value=False)]
    node = UalNode(loop, parameter_overrides=simulated)
    publisher = node.create_publisher(Clock, "/clock", BEST_EFFORT)
    now = Clock()

    def is_now(sec: int) -> bool:
        now.clock.sec = sec
        publisher.publish(now)
        return bool(node.get_clock().now().seconds_nanoseconds()[0] == sec)

    with spinning(node.listener):
        waited(lambda: is_now(1000))
        waited(lambda: is_now(5))
        node.set_parameters([Parameter("use_sim_time", value=False)])
        waited(lambda: publisher.get_subscription_count() == 0)
        assert not is_now(1000)
        node.set_parameters([Parameter("use_sim_time", value=True)])
        waited(lambda: is_now(2000))
    node.destroy_node()
    loop.close()
