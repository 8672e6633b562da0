"""gRPC alone (`benchmarks.bare`), by a call for each setpoint."""

from __future__ import annotations

import grpc

from benchmarks.marks import speed_m_s
from benchmarks.peers.base import SynchronousPeer
from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc


class Peer(SynchronousPeer):
    def connect(self) -> None:
        self._channel = grpc.insecure_channel(self.address)
        self._stub = ual_pb2_grpc.UalServiceStub(self._channel)
        self.send(0)

    def send(self, number: int) -> None:
        request = pb.SetVelocityRequest()
        request.velocity.twist.linear.y = speed_m_s(number)
        self._stub.SetVelocity(request)

    def close(self) -> None:
        self._channel.close()
