"""Options of the server against callers that waste it."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Sequence
from functools import partial
from typing import Any, cast

import grpc

from benchmarks.attacks import http2
from tests.ual_daemon.server.serving import serving, taking
from tests.ual_daemon.server.test_calls import FakeVehicle
from ual import Uav
from ual.types import State
from ual.v1 import ual_pb2_grpc
from ual_daemon.server import server
from ual_daemon.server.calls import Calls
from ual_daemon.server.telemetry_stream import Updates
from ual_daemon.server.transport.base import ServedCall
from ual_daemon.server.transport.selection import Choice
from ual_daemon.server.uav_service import UalServicer
from ual_daemon.vehicle.vehicle import Vehicle

OPTIONS = dict(server._OPTIONS)
_PROBE = "/ual.v1.UalService/Probe"


def with_(**changed: int) -> Sequence[tuple[str, int]]:
    return tuple({**OPTIONS, **{f"grpc.{name}": value for name, value in changed.items()}}.items())


async def idle(channel: grpc.aio.Channel) -> None:
    while (state := channel.get_state()) is not grpc.ChannelConnectivity.IDLE:
        await channel.wait_for_state_change(state)


def attack(address: str, streams: range, *, is_reset: bool) -> http2.Http2Peer:
    """One connection that opens calls, and resets each at once."""
    host, _, port = address.partition(":")
    peer = http2.Http2Peer(host, int(port))
    headers = http2.request("/a.B/Attack")
    for number in streams:
        peer.send(http2.frame(http2.HEADERS, http2.END_HEADERS, 2 * number + 1, headers))
        if is_reset:
            peer.send(http2.frame(http2.RST_STREAM, 0, 2 * number + 1, http2.CANCEL))
    return peer


def test_calls_of_one_connection_beyond_the_limit_never_get_to_python(transport: Choice) -> None:
    async def run() -> None:
        taken: list[ServedCall] = []

        def take(call: ServedCall) -> None:
            if call.method == _PROBE:
                call.finish(b"")
            else:
                call.watch(lambda: None)
                taken.append(call)

        async with taking(transport, take, server._OPTIONS) as address, grpc.aio.insecure_channel(address) as channel:
            peer = await asyncio.to_thread(attack, address, range(1000), is_reset=False)
            probe: Any = channel.unary_unary(_PROBE)
            most = OPTIONS["grpc.max_concurrent_streams"]
            while len(taken) < most:
                await probe(b"")
            for _ in range(20):
                await probe(b"")
            assert len(taken) == most
            peer.close()
            taken.clear()

    asyncio.run(run())


def test_idle_connections_end_and_calls_on_them_come_through_again(transport: Choice) -> None:
    async def run() -> None:
        assert 60_000 <= OPTIONS["grpc.max_connection_idle_ms"] <= 3_600_000
        options = with_(max_connection_idle_ms=200)
        async with (
            taking(transport, lambda call: call.finish(b""), options) as address,
            grpc.aio.insecure_channel(address) as channel,
        ):
            probe: Any = channel.unary_unary(_PROBE)
            await probe(b"")
            await idle(channel)
            await probe(b"")

    asyncio.run(run())


def test_a_connection_with_an_open_stream_is_not_idle(transport: Choice) -> None:
    async def run() -> None:
        held: list[ServedCall] = []

        def take(call: ServedCall) -> None:
            if call.method == _PROBE:
                call.finish(b"")
                return
            call.watch(lambda: None)
            call.begin()
            held.append(call)

        async with (
            taking(transport, take, with_(max_connection_idle_ms=200)) as address,
            grpc.aio.insecure_channel(address) as channel,
            grpc.aio.insecure_channel(address, [("grpc.use_local_subchannel_pool", 1)]) as watching,
        ):
            watch: Any = watching.unary_stream("/a.B/Watch")
            stream = watch(b"")
            await stream.wait_for_connection()
            probe: Any = channel.unary_unary(_PROBE)
            await probe(b"")
            await idle(channel)  # the other one has had its time, too
            assert watching.get_state() is grpc.ChannelConnectivity.READY
            held[0].send(b"still", lambda _: None)
            assert await stream.read() == b"still"
            held.clear()

    asyncio.run(run())


def test_uav_connects_again_when_its_connection_has_ended(transport: Choice) -> None:
    """Each pause is longer than the idle time; where the computer is slow, a connection may end later or never."""

    def fly(address: str) -> None:
        with Uav(address=address, ns="uav_1") as uav:
            for _ in range(5):
                assert uav.state() is State.LANDED_DISARMED
                time.sleep(0.3)  # longer than a connection may be idle

    async def run() -> None:
        vehicle = cast("Vehicle", FakeVehicle())
        servicer = UalServicer(vehicle, Updates(vehicle, lambda _: None))
        register = partial(ual_pb2_grpc.add_UalServiceServicer_to_server, servicer)
        calls = Calls("uav_1", shutdown_refuses=())
        async with serving(transport, calls, register, options=with_(max_connection_idle_ms=100)) as (_, address):
            await asyncio.to_thread(fly, address)

    asyncio.run(run())
