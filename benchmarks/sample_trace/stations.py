"""The stations of a sample, in the order in which it passes them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from benchmarks.marks import number_of_distance
from benchmarks.peers.base import Times
from benchmarks.sample_trace.stamps import Station

SENT = "the vehicle sends"
CALLBACK = "callback"
_POSITION_ID = 32
"""LOCAL_POSITION_NED."""


def of_vehicle() -> Iterator[Station]:
    """Returns the stations from the link to the sample, in whichever process the vehicle's thread is."""
    from ual_daemon.backends.engine.loop import Loop
    from ual_daemon.backends.mavlink.links.udp import UdpLink
    from ual_daemon.backends.mavlink.session.session import MavlinkSession
    from ual_daemon.backends.mavlink.wire.messages import Codec
    from ual_daemon.flight.flight import Flight
    from ual_daemon.vehicle.vehicle import Vehicle

    yield Station(UdpLink, "receive", "the socket is ready", "datagram read", begins=True)
    yield Station(Codec, "decode", "frame checked", "message decoded", number=_of_message)
    yield Station(MavlinkSession, "on_message", after="values taken")
    yield Station(Loop, "publish", "update is due")
    yield Station(MavlinkSession, "snapshot", after="snapshot made")
    yield Station(Vehicle, "_on_update", "update begins")
    yield Station(Flight, "step", "flight begins", "flown")
    yield Station(UdpLink, "send", after="setpoint sent")
    yield Station(Vehicle, "_sample", "state found", "sample made")


def of_class() -> Iterator[Station]:
    """Returns the stations in a program that uses the class interface."""
    from ual.shared.callbacks import Listener

    yield from of_vehicle()
    yield Station(Listener, "put", after="given to the worker")
    yield Station(Listener, "run", "worker runs", begins=True)
    yield _callback()


def of_daemon() -> Iterator[Station]:
    """Returns the stations in the daemon."""
    from ual_daemon.server.packing import TelemetryPacker
    from ual_daemon.server.transport.core import CoreCall

    yield from of_vehicle()
    yield Station(TelemetryPacker, "response", "a reader is due", "message packed")
    yield Station(CoreCall, "send", after="sent by gRPC")


def of_client() -> Iterator[Station]:
    """Returns the stations in a program that uses the client."""
    from ual._subscription import _Feed
    from ual.shared.callbacks import Listener
    from ual.wire import samples

    yield Station(samples, "telemetry_from_proto", "the client has read it", begins=True)
    yield Station(_Feed, "_hand_out", after="handed out")
    yield Station(Listener, "run", "called")
    yield _callback()


OF = {"class": of_class, "daemon": of_daemon, "client": of_client}
"""The stations of each kind of process."""


def _callback() -> Station:
    return Station(Times, "add", CALLBACK, number=lambda _result, _times, number, _at_ns: number)


def _of_message(message: Any, *_: object) -> int | None:  # noqa: ANN401  pymavlink's
    return number_of_distance(message.x) if message.get_msgId() == _POSITION_ID else None
