"""gRPC alone (`benchmarks.bare`), with a stream of setpoints and one of telemetry, without UAL's client."""

from __future__ import annotations

import time
from queue import SimpleQueue

import grpc

from benchmarks.marks import number_of_distance, speed_m_s
from benchmarks.peers.base import SynchronousPeer, Times
from benchmarks.peers.grpc_flood import flood
from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc

_OPENS_S = 0.2


class Peer(SynchronousPeer):
    def connect(self) -> None:
        self._channel = grpc.insecure_channel(self.address)
        self._stub = ual_pb2_grpc.UalServiceStub(self._channel)
        self._given: SimpleQueue[pb.StreamSetpointsRequest | None] = SimpleQueue()
        self._call = self._stub.StreamSetpoints.future(iter(self._given.get, None))
        self.send(0)
        time.sleep(_OPENS_S)

    def send(self, number: int) -> None:
        self._given.put(setpoint(number))

    def flood(self, first: int, duration_s: float) -> int:
        return flood(self._stub, setpoint, first, duration_s)

    def listen(self, subscribers_count: int, duration_s: float) -> Times:
        came = Times()
        call = self._stub.StreamTelemetry(pb.StreamTelemetryRequest(), timeout=duration_s)
        try:
            for response in call:
                number = number_of_distance(response.telemetry.pose.position.y)
                for _ in range(subscribers_count):
                    came.add(number, time.monotonic_ns())
        except grpc.RpcError:
            pass  # the deadline has passed
        return came

    def close(self) -> None:
        self._given.put(None)
        self._channel.close()


def setpoint(number: int) -> pb.StreamSetpointsRequest:
    """Returns a velocity to the north that carries a number."""
    message = pb.StreamSetpointsRequest()
    message.velocity.twist.linear.y = speed_m_s(number)
    return message
