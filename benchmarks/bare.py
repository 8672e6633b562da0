"""gRPC alone: a server with the contract's setpoints and telemetry and nothing behind them. This is the best that a
server in Python can reach. It has no validation, no state and no watchdog: it only converts setpoints and positions.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import socket
from collections.abc import AsyncIterator
from typing import Any

os.environ.setdefault("GRPC_EXPERIMENTS", "-event_engine_listener")  # as the daemon does, before the first import

import grpc
from pymavlink.dialects.v20 import common as mavlink

from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc

_VELOCITY_ONLY = 0b010111000111


class Bare(ual_pb2_grpc.UalServiceServicer):
    """Sends to the vehicle from which messages come at a UDP port."""

    def __init__(self, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", port))
        _, self._vehicle = self._socket.recvfrom(2048)
        self._socket.setblocking(False)
        self._mavlink = mavlink.MAVLink(None, srcSystem=245, srcComponent=190)
        self._receiver = mavlink.MAVLink(None)
        self._readers: set[asyncio.Queue[pb.StreamTelemetryResponse]] = set()
        asyncio.get_running_loop().add_reader(self._socket, self._receive)

    # ruff: noqa: N802
    async def SetVelocity(self, request: pb.SetVelocityRequest, context: Any) -> pb.SetVelocityResponse:  # noqa: ANN401
        self._send(request.velocity)
        return pb.SetVelocityResponse()

    async def StreamSetpoints(self, request_iterator: Any, context: Any) -> pb.StreamSetpointsResponse:  # noqa: ANN401
        count = 0
        async for request in request_iterator:
            self._send(request.velocity)
            count += 1
        return pb.StreamSetpointsResponse(accepted_count=count)

    async def StreamTelemetry(
        self,
        request: pb.StreamTelemetryRequest,
        context: Any,  # noqa: ANN401
    ) -> AsyncIterator[pb.StreamTelemetryResponse]:
        reader: asyncio.Queue[pb.StreamTelemetryResponse] = asyncio.Queue()
        self._readers.add(reader)
        try:
            while True:
                yield await reader.get()
        finally:
            self._readers.discard(reader)

    def _send(self, velocity: pb.TwistStamped) -> None:
        v = velocity.twist.linear
        message = mavlink.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, _VELOCITY_ONLY, 0, 0, 0, v.y, v.x, -v.z, 0, 0, 0, 0, 0
        )
        self._socket.sendto(message.pack(self._mavlink), self._vehicle)
        self._mavlink.seq = (self._mavlink.seq + 1) % 256

    def _receive(self) -> None:
        data = bytearray(self._socket.recv(2048))
        if int.from_bytes(data[7:10], "little") != mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED:
            return
        position = self._receiver.decode(data)
        message = pb.StreamTelemetryResponse()
        to = message.telemetry.pose.position
        to.x, to.y, to.z = position.y, position.x, -position.z
        for reader in self._readers:
            reader.put_nowait(message)


async def _serve(port: int, address: str) -> None:
    bare = Bare(port)  # type: ignore[abstract]  # the other methods answer that they are not there
    server = grpc.aio.server()
    ual_pb2_grpc.add_UalServiceServicer_to_server(bare, server)
    server.add_insecure_port(address)
    await server.start()
    await server.wait_for_termination()


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("port", type=int)
    parser.add_argument("address")
    arguments = parser.parse_args()
    asyncio.run(_serve(arguments.port, arguments.address))
