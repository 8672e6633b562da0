"""Where a client's daemon is, and how to open a channel to it; shared by the client and its asyncio twin."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import grpc

from ual import _discovery
from ual._calls import Call, Service
from ual.errors import InvalidArgumentError
from ual.v1 import simulation_pb2_grpc, ual_pb2_grpc

ADDRESS_VARIABLE = "UAL_ADDRESS"
NS_VARIABLE = "UAL_NS"
NS_METADATA_KEY = "ual-ns"

CHANNEL_OPTIONS: tuple[tuple[str, int], ...] = (
    # A daemon that was restarted is found again within this.
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.max_reconnect_backoff_ms", 500),
    # By its name the same, but it is how long an attempt may take: a busy computer needs more than a few ms.
    ("grpc.min_reconnect_backoff_ms", 3000),
    # Each client has connections of its own, which end with it.
    ("grpc.use_local_subchannel_pool", 1),
    # A daemon's computer that vanished without a word (cable, radio) is noticed within 8 s.
    ("grpc.keepalive_time_ms", 4000),
    ("grpc.keepalive_timeout_ms", 4000),
    # The one that counts with gRPC 1.8x: it waits for the answer to a ping for 60 s by default.
    ("grpc.http2.ping_timeout_ms", 4000),
    ("grpc.http2.max_pings_without_data", 0),
    # A command is sent once; one that gets lost is the caller's to judge.
    ("grpc.enable_retries", 0),
    # A web proxy has no business between a program and its UAV.
    ("grpc.enable_http_proxy", 0),
)


class Stubs:
    """The daemon's services over one channel, of either kind."""

    def __init__(self, channel: Any) -> None:  # noqa: ANN401 (grpc's, or grpc.aio's)
        self.ual = ual_pb2_grpc.UalServiceStub(channel)
        self.simulation = simulation_pb2_grpc.SimulationServiceStub(channel)

    def method(self, call: Call[Any]) -> Any:  # noqa: ANN401 (what is called differs by method and by channel)
        """The method that a call is of."""
        return getattr(self.ual if call.service is Service.UAL else self.simulation, call.method)


@dataclass(slots=True, eq=False)
class Route:
    """A channel, of either kind, to where the daemon was when it was opened. Where the daemon moved, it is closed once
    no call uses it any more: closing it would end their calls.
    """

    address: str
    channel: Any
    stubs: Stubs
    call_count: int = 0


class Target:
    """The daemon that a client means: fixed by an address, or looked up by its namespace whenever that changes."""

    def __init__(self, ns: str | None, address: str | None, tls_ca: str | Path | None) -> None:
        self.ns = ns or os.environ.get(NS_VARIABLE, "")
        given = address or os.environ.get(ADDRESS_VARIABLE) or None
        self._fixed_address = None if given is None else _checked(given)
        self._credentials = None if tls_ca is None else _read_ca(Path(tls_ca))
        self._address: str | None = self._fixed_address
        self._seen: tuple[int, int] | None = None

    @property
    def metadata(self) -> tuple[tuple[str, str], ...]:
        """What every request carries."""
        return ((NS_METADATA_KEY, self.ns),) if self.ns else ()

    @property
    def credentials(self) -> grpc.ChannelCredentials | None:
        """For a secure channel; None for a plain one."""
        return self._credentials

    def address(self) -> str:
        """Where the daemon is now. Costs one look at a file, so it can be asked before each call.

        A daemon that is gone is expected where it was. Where neither namespace nor address was given, it is the only
        daemon of this computer, and from then on the one of that namespace.
        """
        if self._fixed_address is not None:
            return self._fixed_address
        if not self.ns:
            daemon = _discovery.only()
            if daemon is None:
                return _discovery.default_address("")
            self.ns = daemon.ns
        seen = _signature(_discovery.registry_file(self.ns))
        if self._address is None or (seen is not None and seen != self._seen):
            self._seen = seen
            registration = _discovery.registered(self.ns)
            if registration is not None:
                self._address = registration.address
        return self._address or _discovery.default_address(self.ns)


def _checked(address: str) -> str:
    if not re.fullmatch(r"unix:.+|(\[[0-9A-Fa-f:.]+\]|[^\s:/\[\]]+):\d{1,5}", address):
        raise InvalidArgumentError(f"address: {address!r} is none; write HOST:PORT or unix:PATH", {"field": "address"})
    return address


def _signature(file: Path) -> tuple[int, int] | None:
    try:
        stat = file.stat()
    except OSError:
        return None
    return stat.st_mtime_ns, stat.st_ino


def _read_ca(file: Path) -> grpc.ChannelCredentials:
    try:
        certificates = file.read_bytes()
    except OSError as error:
        raise InvalidArgumentError(f"tls_ca: cannot read {file}: {error.strerror}", {"field": "tls_ca"}) from None
    return grpc.ssl_channel_credentials(certificates)
