"""UAL's server with the unary call `SetVelocity`, as from a program without UAL's client."""

from __future__ import annotations

import grpc

import ual
from benchmarks.peers.base import SynchronousPeer, until
from benchmarks.peers.ual_stream import velocity
from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc
from ual.wire import motions


class Peer(SynchronousPeer):
    def connect(self) -> None:
        self._channel = grpc.insecure_channel(self.address)
        self._stub = ual_pb2_grpc.UalServiceStub(self._channel)
        telemetry = pb.GetTelemetryRequest()
        until(
            lambda: self._stub.GetTelemetry(telemetry).telemetry.state == pb.State.STATE_FLYING_AUTO,
            "UAL flies",
        )
        self.send(0)

    def send(self, number: int) -> None:
        twist = motions.setpoint_to_proto(ual.TwistStamped(velocity(number))).velocity
        self._stub.SetVelocity(pb.SetVelocityRequest(velocity=twist))

    def close(self) -> None:
        self._channel.close()
