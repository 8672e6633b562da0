"""A light UAV behind the daemon's server, on one thread, whose time a test steps."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from contextlib import ExitStack
from datetime import datetime, timezone
from pathlib import Path
from typing import NamedTuple, TypeVar
from unittest.mock import patch

import grpc

from tests.ual_daemon.stepped import STEP_S, Stepped, stepped
from tests.work.flights import CORNER
from tests.work.memory_calls import MemoryCall, MemoryTransport
from ual.access.roles import Role
from ual.access.tokens import Token, hashed
from ual.geometry import Vector3
from ual.recording.recorder import SteadyUtc, Turnover
from ual.v1 import ual_pb2 as pb
from ual_daemon import UAL
from ual_daemon.program.recording.audit import Audit
from ual_daemon.program.recording.audit_file import AuditFile
from ual_daemon.program.recording.recording import DaemonRecording
from ual_daemon.server.access.policy import Access
from ual_daemon.server.call_log import CallObserver
from ual_daemon.server.server import Server
from ual_daemon.server.transport.base import Metadata
from ual_daemon.vehicle.vehicle import Vehicle

T = TypeVar("T")

_SECRET, _NAME = "secret", "pilot"
_LEASE_S = 3600.0
"""It need not be kept, however busy the computer is."""


class _Tokens(NamedTuple):
    value: tuple[Token, ...]


class Served:
    """The UAV in the air, and the calls of a program that flies it."""

    def __init__(self, uav: Stepped, transport: MemoryTransport, metadata: Metadata) -> None:
        self._uav, self._transport, self._metadata = uav, transport, metadata

    def step(self) -> None:
        """Lets the time of one update pass."""
        self._uav.run(STEP_S)

    def read(self) -> MemoryCall:
        """Begins to read the telemetry."""
        call = self._transport.call("StreamTelemetry", self._metadata)
        call.deliver(pb.StreamTelemetryRequest().SerializeToString())
        return call

    def stream(self) -> Callable[[Vector3], Callable[[], None]]:
        """Begins a stream of setpoints. Returns the function that makes what sends one."""
        call = self._transport.call("StreamSetpoints", self._metadata)

        def ready(velocity: Vector3) -> Callable[[], None]:
            message = pb.StreamSetpointsRequest(velocity=_request(velocity).velocity).SerializeToString()
            return lambda: call.deliver(message)

        return ready

    def call(self, velocity: Vector3) -> Callable[[], None]:
        """Returns the function that sends a setpoint as a call of its own."""
        message = _request(velocity).SerializeToString()

        def send() -> None:
            call = self._transport.call("SetVelocity", self._metadata)
            call.deliver(message)
            assert call.code is grpc.StatusCode.OK, call.details

        return send


def _request(velocity: Vector3) -> pb.SetVelocityRequest:
    linear = pb.Vector3(x=velocity.x, y=velocity.y, z=velocity.z)
    return pb.SetVelocityRequest(velocity=pb.TwistStamped(twist=pb.Twist(linear=linear)))


def served(fly: Callable[[Served], T], directory: Path, *, has_all: bool) -> T:
    """Flies a UAV beside the corner of a fence, and returns what `fly` returns. One program reads its telemetry.

    With `has_all` it is flown by a token and under a lease, recorded and audited, and an extension and a second program
    have its telemetry, too.
    """
    return asyncio.run(_serve(fly, directory, has_all=has_all))


async def _serve(fly: Callable[[Served], T], directory: Path, *, has_all: bool) -> T:
    with ExitStack() as stack:
        uav = stack.enter_context(stepped(CORNER.settings))
        uav.update_each_step()
        # The recording's periods count in the time of the flight, however busy the computer is.
        stack.enter_context(patch.object(SteadyUtc, "now_ns", lambda _: round(uav.vehicle.clock.now_s() * 1e9)))
        observers = _observers(uav.vehicle, directory, stack) if has_all else []
        transport, access = MemoryTransport(), _access() if has_all else None
        server = Server(uav.vehicle, transport, observers=observers, access=access)
        stack.callback(server.begin_shutdown)
        uav.fly(CORNER.height_m)
        lease_id = uav.vehicle.acquire_lease("a program", _NAME, lasts_s=_LEASE_S) if has_all else ""
        given = (("authorization", f"Bearer {_SECRET}"), ("ual-lease", lease_id)) if has_all else ()
        flown = Served(uav, transport, given)
        readers = [flown.read() for _ in range(2 if has_all else 1)]
        result = fly(flown)
        assert all(reader.sent for reader in readers)
        return result


def _access() -> Access:
    now = datetime.now(timezone.utc)
    return Access(known_tokens=_Tokens((Token(_NAME, Role.PILOT, hashed(_SECRET), now),)))


def _observers(vehicle: Vehicle, directory: Path, stack: ExitStack) -> list[CallObserver]:
    """Begins a recording, an audit, and what an extension does: it has the class interface, and subscribes."""
    recording = DaemonRecording(directory, [vehicle], logging.LogRecord.getMessage, Turnover(), is_raw=True)
    recording.start()
    stack.callback(recording.close)
    audit = Audit(AuditFile(directory / "audit"))
    stack.callback(audit.close)
    of_extension = UAL.over(vehicle, {})
    stack.callback(of_extension.release)
    stack.enter_context(of_extension.subscribe(lambda _: None))
    return [recording.observer(vehicle.ns), audit.observer(vehicle)]
