"""A plain grpcio server with the same calls and nothing behind them: ``python -m benchmarks.attacks.plain PORT SINK``.

It stands for what gRPC in Python withstands by itself. `grpc.server` is its public, synchronous server. A setpoint's
yaw rate goes to a UDP port, and each reader gets 50 samples a second.
"""

from __future__ import annotations

import argparse
import socket
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import grpc

from benchmarks.attacks.autopilot import NUMBER
from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc

_THREADS = 20
_PERIOD_S = 0.02


class Plain(ual_pb2_grpc.UalServiceServicer):
    """Sends to the sink."""

    def __init__(self, sink: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(("127.0.0.1", sink))

    # ruff: noqa: N802
    def GetInfo(self, request: pb.GetInfoRequest, context: Any) -> pb.GetInfoResponse:  # noqa: ANN401
        return pb.GetInfoResponse(namespace="uav_1")

    def GetTelemetry(self, request: pb.GetTelemetryRequest, context: Any) -> pb.GetTelemetryResponse:  # noqa: ANN401
        return pb.GetTelemetryResponse(telemetry=pb.Telemetry(state=pb.STATE_FLYING_AUTO))

    def SetVelocity(self, request: pb.SetVelocityRequest, context: Any) -> pb.SetVelocityResponse:  # noqa: ANN401
        self._send(request.velocity)
        return pb.SetVelocityResponse()

    def StreamSetpoints(self, request_iterator: Any, context: Any) -> pb.StreamSetpointsResponse:  # noqa: ANN401
        count = 0
        for request in request_iterator:
            self._send(request.velocity)
            count += 1
        return pb.StreamSetpointsResponse(accepted_count=count)

    def StreamTelemetry(
        self,
        request: pb.StreamTelemetryRequest,
        context: Any,  # noqa: ANN401
    ) -> Iterator[pb.StreamTelemetryResponse]:
        number = 0
        while context.is_active():
            number += 1
            telemetry = pb.Telemetry(state=pb.STATE_FLYING_AUTO, sequence=number)
            yield pb.StreamTelemetryResponse(telemetry=telemetry)
            time.sleep(_PERIOD_S)

    def _send(self, velocity: pb.TwistStamped) -> None:
        self._socket.send(NUMBER.pack(velocity.twist.angular.z))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("port", type=int)
    parser.add_argument("sink", type=int)
    arguments = parser.parse_args()
    server = grpc.server(ThreadPoolExecutor(_THREADS))
    servicer = Plain(arguments.sink)  # type: ignore[abstract]  # the other methods answer that they are not there
    ual_pb2_grpc.add_UalServiceServicer_to_server(servicer, server)
    server.add_insecure_port(f"127.0.0.1:{arguments.port}")
    server.start()
    server.wait_for_termination()


if __name__ == "__main__":
    main()
