"""The gRPC server of one vehicle."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, cast

import grpc
from grpc_health.v1 import health_pb2
from grpc_reflection.v1alpha import reflection, reflection_pb2_grpc

from ual.access.roles import Role
from ual.errors import NotSupportedError
from ual.interface import Simulation
from ual.shared.tracing import Tracing
from ual.types import State
from ual.v1 import simulation_pb2, simulation_pb2_grpc, ual_pb2, ual_pb2_grpc
from ual_daemon.server import health
from ual_daemon.server.access.policy import Access
from ual_daemon.server.addresses import Address, bind
from ual_daemon.server.call_log import CallObserver, observed
from ual_daemon.server.calls import CallFigures, Calls
from ual_daemon.server.headroom import MOST_REQUEST_BYTES
from ual_daemon.server.motion_gate import MotionGate
from ual_daemon.server.services.simulation import SimulationServicer
from ual_daemon.server.simulation_service import SimulatedTime
from ual_daemon.server.telemetry_stream import LoopCalls, Updates
from ual_daemon.server.traced import traced
from ual_daemon.server.transport.base import MakeCredentials, ServedCall, Transport
from ual_daemon.server.uav_service import UalServicer
from ual_daemon.vehicle.planning import PlanFigures

if TYPE_CHECKING:
    from ual_daemon.choice import ServedVehicle

_UAL_SERVICE: str = ual_pb2.DESCRIPTOR.services_by_name["UalService"].full_name
_SIMULATION_SERVICE: str = simulation_pb2.DESCRIPTOR.services_by_name["SimulationService"].full_name
_HEALTH_SERVICE: str = health_pb2.DESCRIPTOR.services_by_name["Health"].full_name

NEEDED_TO_LAND = frozenset(f"/{_UAL_SERVICE}/{method}" for method in ("SetExternalPose", "StreamExternalPoses"))
"""Methods that a shutdown leaves open until the flight has ended: a UAV may need them to know its position."""

_OPTIONS: Sequence[tuple[str, int]] = (
    # One daemon for a port: with this on (gRPC's default), a second one could listen, too, and get a part of the calls.
    ("grpc.so_reuseport", 0),
    # A host that vanishes silently (cable, radio) is noticed within 8 s, and its flying calls are cancelled.
    ("grpc.keepalive_time_ms", 4000),
    ("grpc.keepalive_timeout_ms", 4000),
    # gRPC 1.8x uses this one: it waits 60 s for the answer to a ping by default.
    ("grpc.http2.ping_timeout_ms", 4000),
    ("grpc.keepalive_permit_without_calls", 1),
    ("grpc.http2.max_pings_without_data", 0),
    # A client may ping the daemon as often.
    ("grpc.http2.min_ping_interval_without_data_ms", 1000),
    # Setpoints that arrive while the daemon cannot read (a stopped process, a busy machine) would all be flown late. By
    # default some 600 fit into the buffers; with these two at most 5 do, and the client drops the rest.
    ("grpc.http2.lookahead_bytes", 512),
    ("grpc.http2.bdp_probe", 0),
    # Calls of one connection that have not ended yet, those included that its caller has reset ("rapid reset"): what is
    # beyond is refused by gRPC, before Python runs. More than the calls of one method that may be in progress.
    ("grpc.max_concurrent_streams", 128),
    # A client that connects has to show it: by a TLS handshake if there is one, and by HTTP/2's preface.
    ("grpc.server_handshake_timeout_ms", 20_000),
    # A connection without a call ends after a while, and leaves its open file to others. Clients connect again when
    # they call.
    ("grpc.max_connection_idle_ms", 600_000),
    ("grpc.max_receive_message_length", MOST_REQUEST_BYTES),
)
_GRACE_S = 1.0


class AddedService(Protocol):
    """A service of an extension; see `ual_daemon.extensions.base.Service`."""

    @property
    def name(self) -> str:
        """Its full name."""

    @property
    def add_to_server(self) -> Callable[[Any], None]:
        """Registers its methods."""

    @property
    def roles(self) -> Mapping[str, Role]:
        """The role that each of its methods needs."""


class ServerFigures(NamedTuple):
    """Measurements of a server: its calls, the samples that slow readers have missed, and the plans."""

    calls: CallFigures
    missed_count: int
    plans: PlanFigures


class Server:
    """Serves a vehicle, and its simulation if it has one, on the event loop that runs when this is made.

    Servers of one process share the `transport` and the `loop_calls`.
    """

    def __init__(
        self,
        vehicle: ServedVehicle,
        transport: Transport,
        loop_calls: LoopCalls | None = None,
        observers: Sequence[CallObserver] = (),
        access: Access | None = None,
        more: Sequence[AddedService] = (),
        time_of: Callable[[Simulation], SimulatedTime] | None = None,
        tracing: Tracing | None = None,
        motion_gate: MotionGate | None = None,
    ) -> None:
        """`observers` observe each call; see `call_log`. `access` identifies callers; None: any caller on this
        computer. `more` are the services of extensions. `time_of` returns the time that callers change for a
        simulation, if that is not its own. `tracing` traces each call. `motion_gate` refuses motions.
        """
        self._simulation: SimulationServicer | None = None
        simulation = _simulation(vehicle)
        services = [_UAL_SERVICE] if simulation is None else [_UAL_SERVICE, _SIMULATION_SERVICE]
        services += [service.name for service in more]
        # During a shutdown only flying is refused: a simulated safety pilot must be able to act until the end.
        self._calls = calls = Calls(
            vehicle.ns,
            log_name=vehicle.log_name,
            shutdown_refuses=(f"/{_UAL_SERVICE}/",),
            shutdown_keeps=NEEDED_TO_LAND | {health.WATCH},  # watchers are informed of the shutdown
            access=access,
            motion_gate=motion_gate,
        )
        self._health = health.HealthServicer(services)
        self.updates = Updates(vehicle, self._on_state, loop_calls, is_sent_on_loop=transport.is_on_loop)
        self._server = transport.server(_OPTIONS, _watched(calls.on_call, observers, tracing))
        registry = cast("grpc.aio.Server", calls)
        self._servicer = UalServicer(vehicle, self.updates)
        ual_pb2_grpc.add_UalServiceServicer_to_server(self._servicer, registry)
        if simulation is not None:
            self._simulation = SimulationServicer(simulation, None if time_of is None else time_of(simulation))
            simulation_pb2_grpc.add_SimulationServiceServicer_to_server(self._simulation, registry)
        for service in more:
            calls.add_roles(service.name, service.roles)
            service.add_to_server(registry)
        health.add_to_server(self._health, registry)
        names = [*services, _HEALTH_SERVICE, reflection.SERVICE_NAME]
        servicer = reflection.aio.ReflectionServicer(names)
        reflection_pb2_grpc.add_ServerReflectionServicer_to_server(servicer, registry)  # type: ignore[no-untyped-call]

    def figures(self) -> ServerFigures:
        """Returns what is measured of it, as it is now. From any thread."""
        return ServerFigures(self._calls.figures, self.updates.missed_count, self._servicer.plans)

    def listen(self, addresses: Sequence[Address], credentials: MakeCredentials | None = None) -> tuple[Address, ...]:
        """Opens the addresses, before `start`. Returns them with the ports that they got.

        Raises:
            ListenError: One of the addresses cannot be had.

        """
        return tuple(bind(self._server, address, credentials) for address in addresses)

    async def start(self) -> None:
        """Begins to serve on the addresses that were opened."""
        await self._server.start()

    def begin_shutdown(self) -> None:
        """Reports that it no longer serves, ends the streams, and refuses new flying calls. Running ones go on."""
        self._health.set_serving(False)
        self.updates.close()
        self._calls.begin_shutdown()

    async def stop(self) -> None:
        """Ends the calls that still wait, and closes."""
        self._calls.end_waiting()
        await self._server.stop(_GRACE_S)
        if self._simulation is not None:
            self._simulation.close()

    def _on_state(self, state: State) -> None:
        self._health.set_serving(state is not State.UNINITIALIZED)


def _watched(
    take: Callable[[ServedCall], None], observers: Sequence[CallObserver], tracing: Tracing | None
) -> Callable[[ServedCall], None]:
    """Returns what takes the calls, and has them observed and traced where that is wanted."""
    take = observed(take, observers) if observers else take
    return take if tracing is None else traced(take, tracing)


def _simulation(vehicle: ServedVehicle) -> Simulation | None:
    try:
        return vehicle.simulation()
    except NotSupportedError:
        return None
