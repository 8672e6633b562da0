"""All that one UAV has in ROS beside flying: what `ual_ros2.interface` needs to know of it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Iterable
from concurrent.futures import Future
from functools import partial
from typing import Any

from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import UInt8MultiArray

import ual
from ual_ros2 import topics
from ual_ros2.command import ActionCommand, RosCommand
from ual_ros2.late_service import LateService
from ual_ros2.messages import Entity, Message
from ual_ros2.ros_time import RosTime
from ual_ros2.services import simulation
from ual_ros2.services.corrections import CorrectionsRelay
from ual_ros2.services.filling import Filling
from ual_ros2.services.publishing import TopicPublisher, topics_of
from ual_ros2.services.service_table import ServiceTable
from ual_ros2.settings import NodeSettings

CORRECTIONS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
"""Each message counts."""

Serve = Callable[[RosCommand, Message, float], Future[Message]]
"""Takes the command, its request, and when that was sent (UTC; 0: not known)."""


class UavServices:
    """The services, topics and actions of one UAV beside flying.

    Args:
        node: Has them.
        loop: On which all but construction and `destroy` runs.
        settings: The node's parameters.
        time: The node's clock.
        uav: The client.
        ns: Its name.
        serve: Answers a request.

    """

    def __init__(
        self,
        node: Entity,
        loop: asyncio.AbstractEventLoop,
        settings: NodeSettings,
        time: RosTime,
        uav: ual.aio.Uav,
        ns: str,
        serve: Serve,
    ) -> None:
        self._node = node
        self._uav = uav
        self._prefix = f"/{ns}/ual"
        self._period_s = 1.0 / settings.slow_rate_hz
        self._serve = serve
        self._corrections = CorrectionsRelay(loop, uav)
        self._table = ServiceTable(Filling(time), self._corrections, settings.log_directory)
        self._tellers = [TopicPublisher(node, uav, ns, time, each) for each in topics_of(self._corrections)]
        self._services = [self._service(each) for each in self._table.services()]
        self._is_simulated = False
        self._incoming = node.create_subscription(
            UInt8MultiArray,
            f"{self._prefix}/corrections",
            callback=lambda message: self._corrections.put(message.data.tobytes()),
            **topics.overridable(CORRECTIONS),
        )

    @property
    def actions(self) -> Iterable[ActionCommand]:
        """The actions."""
        return self._table.actions()

    def works(self) -> list[Coroutine[Any, Any, None]]:
        """Returns what is to run while the node is active."""
        telling = [each.follow(self._period_s) for each in self._tellers]
        return [*telling, self._corrections.run()]

    async def on_connected(self, info: ual.Info) -> None:
        """Adds the services of the simulation where the daemon has one. It is asked once for each connection."""
        if not self._is_simulated and await simulation.is_available(self._uav, info):
            self._is_simulated = True
            self._services += [self._service(each) for each in self._table.simulation()]

    def destroy(self) -> None:
        """Ends its services and topics."""
        for service in self._services:
            self._node.destroy_service(service.entity)
        for teller in self._tellers:
            teller.destroy()
        self._node.destroy_subscription(self._incoming)

    def _service(self, command: RosCommand) -> LateService:
        return LateService(self._node, command.kind, f"{self._prefix}/{command.name}", partial(self._serve, command))
