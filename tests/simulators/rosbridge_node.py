"""A node behind a real rosbridge: ``python -m tests.simulators.rosbridge_node 9090 osdk``.

It serves a simulated DJI aircraft.

It is a client of the bridge that advertises, publishes and serves; messages that the bridge must know are those of
std_msgs, geometry_msgs, sensor_msgs and dji_osdk_ros.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from tests.simulators.dji import STEP_S, Aircraft, Front, OsdkSdkNode, OsdkVehicleNode
from tests.simulators.rosbridge import RefusedError, json_ready, stamped

FRONTS = {"osdk": OsdkSdkNode, "osdk_vehicle": OsdkVehicleNode}
SERVICES = {
    "/dji_osdk_ros/sdk_control_authority": "dji_osdk_ros/SDKControlAuthority",
    "/dji_osdk_ros/drone_arm_control": "dji_osdk_ros/DroneArmControl",
    "/dji_osdk_ros/drone_task_control": "dji_osdk_ros/DroneTaskControl",
    "/obtain_release_control_authority": "dji_osdk_ros/ObtainControlAuthority",
    "/flight_task_control": "dji_osdk_ros/FlightTaskControl",
    "/set_joystick_mode": "dji_osdk_ros/SetJoystickMode",
    "/joystick_action": "dji_osdk_ros/JoystickAction",
}


class RosbridgeNode:
    """Publishes what a front sends, in real time, and executes what is called."""

    def __init__(self, connection: ClientConnection, front: Front) -> None:
        self._connection = connection
        self._front = front
        self.lock = threading.RLock()
        """Held while the aircraft is stepped, or executes a call."""
        self.ended = threading.Event()
        """The bridge has gone."""

    def advertise(self) -> None:
        """Announces topics and services, and subscribes."""
        for topic, kind in self._front.topics.items():
            self._send({"op": "advertise", "topic": topic, "type": kind})
        for topic, (kind, _) in self._front.subscriptions.items():
            self._send({"op": "subscribe", "topic": topic, "type": kind, "queue_length": 1})
        for name in self._front.services:
            self._send({"op": "advertise_service", "service": name, "type": SERVICES[name]})

    def receive(self) -> None:
        """Receives until the connection ends, even in the middle of an answer."""
        with suppress(ConnectionClosed):
            for text in self._connection:
                operation = json.loads(text)
                with self.lock:
                    self._execute(operation)

    def run(self) -> None:
        """Advances the aircraft in real time, until the connection ends."""
        begun_s = time.monotonic()
        with suppress(ConnectionClosed):
            while True:
                with self.lock:
                    messages = list(self._front.step(time.monotonic() - begun_s))
                for topic, message in messages:
                    if topic != "/rosout":
                        self._send({"op": "publish", "topic": topic, "msg": json_ready(stamped(message, 1))})
                time.sleep(STEP_S / 4.0)
        self.ended.set()

    def _execute(self, operation: dict[str, Any]) -> None:
        if operation["op"] == "publish":
            self._front.subscriptions[operation["topic"]][1](operation["msg"])
        elif operation["op"] == "call_service":
            self._send({"op": "service_response", "id": operation["id"], **self._call(operation)})

    def _call(self, operation: dict[str, Any]) -> dict[str, Any]:
        name = operation["service"]
        try:
            values = self._front.services[name](operation["args"])
        except RefusedError:
            return {"service": name, "values": {}, "result": False}
        return {"service": name, "values": values, "result": True}

    def _send(self, operation: dict[str, Any]) -> None:
        self._connection.send(json.dumps(operation))


@contextmanager
def served(port: int, front: Front) -> Iterator[RosbridgeNode]:
    """Serves a front behind the bridge at a port of 127.0.0.1, on threads of its own, until the end or the bridge's."""
    with closing(connect(f"ws://127.0.0.1:{port}", compression=None)) as connection:
        node = RosbridgeNode(connection, front)
        node.advertise()
        threads = [threading.Thread(target=run, daemon=True) for run in (node.receive, node.run)]
        for thread in threads:
            thread.start()
        yield node
    for thread in threads:
        thread.join()


def main(port: int, name: str) -> None:
    """Connects, and serves until the bridge goes."""
    with served(port, FRONTS[name](Aircraft())) as node:
        node.ended.wait()


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
