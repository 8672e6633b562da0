"""The node: ``ros2 run ual_ros2 node --ros-args -p ns:=uav_1``."""

from __future__ import annotations

import asyncio
import functools
import logging
import signal
import sys
import threading
from collections.abc import Callable, Coroutine, Sequence
from concurrent.futures import TimeoutError  # noqa: A004 (Python's own from 3.11 on)
from typing import Any

import rclpy
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.signals import SignalHandlerOptions
from rclpy.time_source import CLOCK_TOPIC

import ual
from ual import discovery
from ual.shared.waiting import ends_within
from ual_ros2 import entities
from ual_ros2 import settings as parameters
from ual_ros2.frames import Tf
from ual_ros2.interface import Shared, UavInterface
from ual_ros2.listener import TopicListener
from ual_ros2.messages import Entity
from ual_ros2.ros_time import RosTime
from ual_ros2.settings import NodeSettings

LOOK_S = 1.0
"""Seconds between two searches of the node for UAVs of this computer, and between its attempts to start where that
failed.
"""
ENDING_S = 10.0
ANSWERS_S = 0.2
"""Seconds for which ROS' executor still runs in the end, so that the results of goals leave."""


Transition = Callable[["UalNode", LifecycleState], TransitionCallbackReturn]


def _loud(transition: Transition) -> Transition:
    """Says why a transition has failed: rclpy says nothing, and calls `on_error`."""

    @functools.wraps(transition)
    def tried(node: UalNode, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            return transition(node, state)
        except Exception as error:  # noqa: BLE001 (whatever it is, it must be said)
            node.get_logger().error(f"{transition.__name__} failed: {type(error).__name__}: {error}")
            return TransitionCallbackReturn.ERROR

    return tried


class UalNode(LifecycleNode):
    """A lifecycle node that is a client of daemons. It tells and flies while it is active."""

    _listener: TopicListener | None = None

    def __init__(self, loop: asyncio.AbstractEventLoop, **options: Any) -> None:  # noqa: ANN401 (rclpy's own)
        super().__init__("ual", **options)
        parameters.declare(self)
        self._loop = loop
        self._shared: Shared | None = None
        self._uavs: dict[str, UavInterface] = {}
        self._is_active = False
        self.has_shut_down = False
        self._failure = ""
        self._left_out: set[str] = set()
        # Not ROS' clock, which may stand still or jump.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._is_starting = bool(self.get_parameter("autostart").value)
        self.create_timer(LOOK_S, self._poll, clock=steady)
        self.add_on_set_parameters_callback(self._on_parameters)
        for words in parameters.unknown(self._parameter_overrides, self._parameters):  # rclpy has them nowhere else
            self.get_logger().warning(words)

    @property
    def listener(self) -> TopicListener:
        """Hears what comes often. It is made when it is first needed, as rclpy hears the clock before all else."""
        if self._listener is None:
            self._listener = TopicListener(self)
        return self._listener

    def create_subscription(self, kind: Entity, topic: str, *arguments: Any, **options: Any) -> Entity:  # noqa: ANN401 (rclpy's own)
        """Does what rclpy's own does, but for the simulated time: the listener hears it, for a fraction of the cost."""
        if topic == CLOCK_TOPIC and "callback_group" not in options:
            return self.listener.subscribe(kind, topic, *arguments, **options)
        return super().create_subscription(kind, topic, *arguments, **options)

    def destroy_subscription(self, subscription: Entity) -> bool:
        """Does what rclpy's own does, also for what the listener hears."""
        if self._listener is not None:
            self._listener.forget(subscription)
        return bool(super().destroy_subscription(subscription))

    def _on_parameters(self, given: Sequence[Entity]) -> SetParametersResult:
        values = {each.name: each.value for each in given}
        reason = parameters.refusal(values, is_configured=self._shared is not None)
        return SetParametersResult(successful=not reason, reason=reason)

    @_loud
    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Reads the parameters and makes all topics, services and actions."""
        try:
            settings = parameters.read(self)
            named = self._named(settings)
            time = RosTime(self.get_clock())
            tf = Tf(self, time, self.listener, settings.transform_tolerance_s)
            self._shared = Shared(self, self._loop, settings, time, tf, self.listener)
            for ns, address in named.items():
                self._add(ns, address)
        except ual.UalError as error:
            return self._failed(error)
        return TransitionCallbackReturn.SUCCESS

    @_loud
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begins to tell and to fly."""
        self._is_starting = False
        self._is_active = True
        for uav in self._uavs.values():
            self._wait(uav.begin())
        return TransitionCallbackReturn.SUCCESS

    @_loud
    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Ends what it flies: a go-to or path ends, and the UAV holds; a take-off or a landing goes on."""
        self._end("the node is not active")
        return TransitionCallbackReturn.SUCCESS

    @_loud
    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Ends all topics, services and actions, and the connections."""
        self._is_starting = False
        self._destroy_all()
        return TransitionCallbackReturn.SUCCESS

    @_loud
    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Ends what it flies, from any state. Services and actions stay until the process ends, for their answers."""
        self._is_starting = False
        self.has_shut_down = True
        self._end("the node has ended")
        return TransitionCallbackReturn.SUCCESS

    @_loud
    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Ends all after a transition that failed, once: the node is unconfigured then, and waits for its user."""
        self._is_starting = False
        self._end("the node has failed")
        self._destroy_all()
        return TransitionCallbackReturn.SUCCESS

    async def close(self) -> None:
        """Ends the connections, all at once."""
        await asyncio.gather(*(uav.close() for uav in self._uavs.values()))

    def _named(self, settings: NodeSettings) -> dict[str, str]:
        """Returns the addresses of the UAVs by their names, which the daemons are asked for where none are given."""
        if not settings.uavs:
            return dict.fromkeys(self._found(), "")
        pairs = [(ns or self._ask_name(settings, address), address) for ns, address in settings.uavs]
        named = {parameters.require_name(ns): address for ns, address in pairs}
        if len(named) < len(pairs):
            raise ual.InvalidArgumentError("address: two daemons fly UAVs of one name", {"field": "address"})
        return named

    def _found(self) -> set[str]:
        """Returns the UAVs of this computer whose names ROS can have; says once of each other that it cannot."""
        found = {daemon.ns for daemon in discovery.list_daemons()} - self._left_out
        for ns in tuple(found):
            try:
                parameters.require_name(ns)
            except ual.InvalidArgumentError as error:
                self.get_logger().error(error.message)
                self._left_out.add(ns)
        return found - self._left_out

    def _ask_name(self, settings: NodeSettings, address: str) -> str:
        with ual.Uav(address=address, tls_ca=settings.tls_ca, credentials=settings.credentials) as uav:
            return uav.ns

    def _add(self, ns: str, address: str) -> None:
        assert self._shared is not None
        try:
            self._uavs[ns] = UavInterface(self._shared, ns, address)
        except BaseException:  # as of a wrong QoS override: what is left would be in the graph, and do nothing
            entities.destroy_below(self, f"/{ns}/ual/")
            raise
        self.get_logger().info(f"{ns}: /{ns}/ual/ is there")

    def _poll(self) -> None:
        """Starts the node where it is to start by itself, and finds UAVs whose daemons were started later."""
        if self._is_starting:
            self._start()
        if self._shared is not None and not self._shared.settings.uavs:
            for ns in self._found() - self._uavs.keys():
                self._add_late(ns)

    def _add_late(self, ns: str) -> None:
        """Adds a UAV while others fly: if that fails, it is said, and they go on."""
        try:
            self._add(ns, "")
        except Exception as error:  # noqa: BLE001 (whatever it is, the others fly)
            self.get_logger().error(f"{ns} is left out: {type(error).__name__}: {error}")
            self._left_out.add(ns)
            return
        if self._is_active:
            self._wait(self._uavs[ns].begin())

    def _start(self) -> None:
        if self._shared is None and self.trigger_configure() is not TransitionCallbackReturn.SUCCESS:
            return
        self.trigger_activate()

    def _failed(self, error: ual.UalError) -> TransitionCallbackReturn:
        self._destroy_all()
        text = f"{error.reason}: {error.message}"
        if text != self._failure:
            self.get_logger().error(f"not configured: {text}")
        self._failure = text
        return TransitionCallbackReturn.FAILURE

    def _end(self, why: str) -> None:
        self._is_active = False
        self._wait(self.end_all(why))

    async def end_all(self, why: str) -> None:
        """Ends all at once: a daemon that hangs delays no other."""
        await asyncio.gather(*(uav.end(why) for uav in self._uavs.values()))

    def _destroy_all(self) -> None:
        for uav in self._uavs.values():
            uav.destroy()
        self._wait(self.close())
        self._uavs.clear()
        if self._shared is not None:
            self._shared.tf.destroy()
            self._shared = None

    def _wait(self, coroutine: Coroutine[Any, Any, None]) -> None:
        try:
            asyncio.run_coroutine_threadsafe(coroutine, self._loop).result(ENDING_S)
        except TimeoutError:
            self.get_logger().warning(f"a daemon has not answered within {ENDING_S:g} s")


class _RosLog(logging.Handler):
    """Passes the log of the client and of this package to ROS."""

    def __init__(self, node: Entity) -> None:
        super().__init__(logging.INFO)
        self._log = node.get_logger()

    def emit(self, record: logging.LogRecord) -> None:
        if record.levelno >= logging.ERROR:
            self._log.error(self.format(record))
        elif record.levelno >= logging.WARNING:
            self._log.warning(self.format(record))
        else:
            self._log.info(self.format(record))


async def run(argv: Sequence[str] | None, stop: asyncio.Event) -> bool:
    """Runs the node until `stop` is set. Returns False where it failed before."""
    loop = asyncio.get_running_loop()
    try:
        rclpy.init(args=None if argv is None else list(argv), signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # rclpy's own have no other base
        print(f"ual_ros2: its arguments are wrong: {error}", file=sys.stderr)
        return False
    node = UalNode(loop)
    for name in ("ual", "ual_ros2"):
        logging.getLogger(name).addHandler(_RosLog(node))
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    has_failed = threading.Event()
    spinning = [
        threading.Thread(target=_spin, args=(each, loop, stop, has_failed), name=name, daemon=True)
        for name, each in (("ros", executor), ("topics", node.listener))
    ]
    for thread in spinning:
        thread.start()
    await stop.wait()
    if has_failed.is_set():
        await node.end_all("the node has failed")
    elif not node.has_shut_down:
        await _finish(node, executor)
    node.listener.end()
    rclpy.try_shutdown()
    for thread in spinning:
        thread.join(ENDING_S)
    await node.close()
    return not has_failed.is_set()


def _spin(executor: Entity, loop: asyncio.AbstractEventLoop, stop: asyncio.Event, has_failed: threading.Event) -> None:
    try:
        executor.spin()
    except ExternalShutdownException:
        return
    except BaseException:
        has_failed.set()
        loop.call_soon_threadsafe(stop.set)
        raise


async def _finish(node: Entity, executor: Entity) -> None:
    """Ends the flights while ROS still answers, so that each caller hears how."""
    loop, has_ended = asyncio.get_running_loop(), asyncio.Event()
    ended = executor.create_task(node.trigger_shutdown)
    ended.add_done_callback(lambda _: loop.call_soon_threadsafe(has_ended.set))
    await ends_within(has_ended.wait(), ENDING_S)
    await asyncio.sleep(ANSWERS_S)


def main(argv: Sequence[str] | None = None) -> None:
    """Runs the node until SIGINT or SIGTERM."""

    async def until_signal() -> bool:
        stop = asyncio.Event()
        for number in (signal.SIGINT, signal.SIGTERM):
            asyncio.get_running_loop().add_signal_handler(number, stop.set)
        return await run(argv, stop)

    sys.exit(0 if asyncio.run(until_signal()) else 1)
