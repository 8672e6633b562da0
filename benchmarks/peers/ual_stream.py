"""UAL's server through its client, `ual.Uav`, whose setpoints are streamed."""

from __future__ import annotations

import time

import grpc

import ual
from benchmarks.marks import yaw_rate_rad_s
from benchmarks.peers.base import SynchronousPeer, Times, until
from benchmarks.peers.grpc_flood import flood
from benchmarks.peers.ual_samples import listen
from ual.types import State
from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc
from ual.wire import motions


class Peer(SynchronousPeer):
    def connect(self) -> None:
        self._uav = ual.Uav(address=self.address)
        until(lambda: self._uav.state() is State.FLYING_AUTO, "UAL flies")
        for _ in range(3):  # the first one is a call, the second one opens the stream
            self.send(0)
            time.sleep(0.1)

    def send(self, number: int) -> None:
        self._uav.set_velocity(velocity(number))

    def flood(self, first: int, duration_s: float) -> int:
        """Uses the contract's stream directly, because the client sends only the newest setpoint."""
        with grpc.insecure_channel(self.address) as channel:
            return flood(ual_pb2_grpc.UalServiceStub(channel), _setpoint, first, duration_s)

    def listen(self, subscribers_count: int, duration_s: float) -> Times:
        return listen(self._uav, subscribers_count, duration_s)

    def close(self) -> None:
        self._uav.close()


def _setpoint(number: int) -> pb.StreamSetpointsRequest:
    return motions.setpoint_to_proto(ual.TwistStamped(velocity(number)))


def velocity(number: int) -> ual.Twist:
    """Returns a velocity to the north, with a turn that carries a number."""
    return ual.Twist(ual.Vector3(0.0, 1.5, 0.0), ual.Vector3(0.0, 0.0, yaw_rate_rad_s(number)))
