"""UAL's server through its client, `ual.Uav`, whose setpoints are streamed."""

from __future__ import annotations

import time
from collections.abc import Iterator

import grpc

import ual
from benchmarks.marks import number_of_distance, speed_m_s
from benchmarks.peers.base import SynchronousPeer, Times, until
from ual import convert
from ual.types import State, Telemetry
from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc


class Peer(SynchronousPeer):
    def connect(self) -> None:
        self._uav = ual.Uav(address=self.address)
        until(lambda: self._uav.state() is State.FLYING_AUTO, "UAL flies")
        for _ in range(3):  # the first is a call of its own, the second opens the stream
            self.send(0)
            time.sleep(0.1)

    def send(self, number: int) -> None:
        self._uav.set_velocity(velocity(number))

    def flood(self, first: int, duration_s: float) -> int:
        """By the contract's stream itself: of the client's setpoints only the newest is sent, which can be no flood."""
        count = 0

        def setpoints() -> Iterator[pb.StreamSetpointsRequest]:
            nonlocal count
            ends_s = time.monotonic() + duration_s
            while time.monotonic() < ends_s:
                yield convert.setpoint_to_proto(ual.TwistStamped(velocity(first + count)))
                count += 1

        with grpc.insecure_channel(self.address) as channel:
            ual_pb2_grpc.UalServiceStub(channel).StreamSetpoints(setpoints())
        return count

    def listen(self, subscribers_count: int, duration_s: float) -> Times:
        came = Times()

        def note(sample: Telemetry) -> None:
            if sample.pose is not None:
                came.add(number_of_distance(sample.pose.position.y), time.monotonic_ns())

        subscriptions = [self._uav.subscribe(note) for _ in range(subscribers_count)]
        time.sleep(duration_s)
        for subscription in subscriptions:
            subscription.close()
        return came

    def close(self) -> None:
        self._uav.close()


def velocity(number: int) -> ual.Twist:
    """A velocity to the north that says a number."""
    return ual.Twist(ual.Vector3(0.0, speed_m_s(number), 0.0))
