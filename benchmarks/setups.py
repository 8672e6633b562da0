"""The ways to fly that are compared: which client, with which server."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from benchmarks.children import Child, ChildError, free_port
from benchmarks.peers import is_missing
from benchmarks.servers import BareServer, MavsdkServer, UalDaemon


@dataclass(frozen=True)
class ClientSetup:
    """One way: its name in tables, the module of `benchmarks.peers`, and the server's address, if there is a server.

    `flags` are further ones of ``ual-daemon``. With `has_fence` the vehicle has a fence of its own, and so has UAL.
    """

    name: str
    peer: str
    address: str = ""
    flags: tuple[str, ...] = ()
    has_fence: bool = False

    @property
    def is_missing(self) -> bool:
        """Whether a package that it needs is not installed."""
        return is_missing(self.peer)


FENCE = ((-8.0, -8.0), (13.0, -8.0), (13.0, 72.0), (-8.0, 72.0))
"""The configured fence, x and y in metres in ``uav_1/odom``: its nearest edge is 8 m beside the vehicle."""
FENCE_FLAGS = ("--set", f"geofence.polygon={[list(corner) for corner in FENCE]}")
"""The flags of ``ual-daemon`` that configure it."""

RAW = ClientSetup("pymavlink", "raw")
NATIVE = ClientSetup("mavsdk", "native")
MAVSDK_GRPC = ClientSetup("mavsdk-grpc", "mavsdk_grpc", "tcp")
CLASS = ClientSetup("UAL class", "ual_class")
STREAM = ClientSetup("UAL stream", "ual_stream", "tcp")
STREAM_UNIX = ClientSetup("UAL stream, unix", "ual_stream", "unix")
STREAM_AIO = ClientSetup("UAL stream, grpc.aio", "ual_stream", "tcp", ("--transport", "aio"))
UNARY = ClientSetup("UAL unary", "ual_unary", "tcp")
UNARY_UNIX = ClientSetup("UAL unary, unix", "ual_unary", "unix")
UNARY_AIO = ClientSetup("UAL unary, grpc.aio", "ual_unary", "tcp", ("--transport", "aio"))
CLASS_FENCE = ClientSetup("UAL class, fence", "ual_class_fence", has_fence=True)
STREAM_FENCE = ClientSetup("UAL stream, fence", "ual_stream", "tcp", FENCE_FLAGS, has_fence=True)
UNARY_FENCE = ClientSetup("UAL unary, fence", "ual_unary", "tcp", FENCE_FLAGS, has_fence=True)
BARE_STREAM = ClientSetup("gRPC alone, stream", "grpc_stream", "tcp")
BARE_UNARY = ClientSetup("gRPC alone, unary", "grpc_unary", "tcp")
FLOORS = {
    **dict.fromkeys((STREAM, STREAM_FENCE), BARE_STREAM),
    **dict.fromkeys((UNARY, UNARY_FENCE), BARE_UNARY),
    **dict.fromkeys((CLASS, CLASS_FENCE), RAW),
}
"""For each way, the one that does the same without UAL: the cost of Python and gRPC alone."""

SETPOINT_WAYS = (
    *(RAW, NATIVE, CLASS, CLASS_FENCE, MAVSDK_GRPC),
    *(BARE_STREAM, STREAM, STREAM_FENCE, STREAM_UNIX, STREAM_AIO),
    *(BARE_UNARY, UNARY, UNARY_FENCE, UNARY_UNIX, UNARY_AIO),
)
TELEMETRY_WAYS = (MAVSDK_GRPC, BARE_STREAM, STREAM, STREAM_AIO, NATIVE, CLASS)
SERVER_WAYS = (MAVSDK_GRPC, STREAM, STREAM_FENCE)

Server = UalDaemon | MavsdkServer | BareServer


@dataclass
class SetupFlight:
    """One way with its processes."""

    way: ClientSetup
    port: int
    client: Child
    server: Server | None

    def prefer(self) -> None:
        """Gives its processes priority over others."""
        for process in (self.client, self.server):
            if process is not None:
                process.prefer()


@contextmanager
def server_of(way: ClientSetup, port: int) -> Iterator[Server | None]:
    """Returns the server of a way, for the vehicle that sends to a port. The vehicle must be flying."""
    if not way.address:
        yield None
        return
    kinds: dict[ClientSetup, type[MavsdkServer | BareServer]] = {
        MAVSDK_GRPC: MavsdkServer,
        BARE_STREAM: BareServer,
        BARE_UNARY: BareServer,
    }
    with kinds[way](port) if way in kinds else UalDaemon(port, *way.flags) as server:
        server.wait()
        try:
            yield server
        except ChildError as error:
            said = server.log_text() if isinstance(server, UalDaemon) else ""
            raise ChildError(f"{error}; its server said:\n{said}") from None


@contextmanager
def running_setup(vehicle: Child, way: ClientSetup) -> Iterator[SetupFlight]:
    """Provides the vehicle, its server and client, once all are connected and a setpoint was sent."""
    port = free_port(socket.SOCK_DGRAM)
    vehicle.ask("fly", port=port, has_fence=way.has_fence)
    with ExitStack() as stack:
        server = stack.enter_context(server_of(way, port))
        address = "" if server is None else server.addresses[way.address]
        client = stack.enter_context(Child("benchmarks.peers", way.peer, "--port", str(port), "--address", address))
        client.ask("connect")
        try:
            yield SetupFlight(way, port, client, server)
        finally:
            vehicle.ask("rest")
