"""Address of a client's daemon, and the opening of a channel to it. Both clients, with and without asyncio, use
this.
"""

from __future__ import annotations

import re
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import grpc

from ual import _gevent, discovery
from ual._calls import Call
from ual._service_calls.stubs import STUBS
from ual.credentials import Credentials, read
from ual.errors import InvalidArgumentError
from ual.shared import environment

if TYPE_CHECKING:
    from ual.network import Network, NetworkSettings

    NetworkChoice: TypeAlias = Network | NetworkSettings | str | Path

NS_METADATA_KEY = "ual-ns"
LEASE_METADATA_KEY = "ual-lease"

SETTLING_S = 0.05
"""Seconds between two checks whether the network is known (`DaemonTarget.is_settled`)."""

CHANNEL_OPTIONS: tuple[tuple[str, int], ...] = (
    # The longest pause between two attempts to connect: a restarted daemon is found again within 500 ms.
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.max_reconnect_backoff_ms", 500),
    # Despite its name, this is how long one attempt may take: a busy computer needs more than a few ms.
    ("grpc.min_reconnect_backoff_ms", 3000),
    # Each client has its own connections, which end with it.
    ("grpc.use_local_subchannel_pool", 1),
    # If the daemon's computer disappears without closing the connection (cable, radio), this is noticed within 8 s.
    ("grpc.keepalive_time_ms", 4000),
    ("grpc.keepalive_timeout_ms", 4000),
    # gRPC 1.8x uses this option: by default it waits 60 s for the answer to a ping.
    ("grpc.http2.ping_timeout_ms", 4000),
    ("grpc.http2.max_pings_without_data", 0),
    # A command is sent only once. If it gets lost, the caller decides what to do.
    ("grpc.enable_retries", 0),
    # The environment's web proxy is not for connections to a UAV.
    ("grpc.enable_http_proxy", 0),
)


class Stubs:
    """The daemon's services over one channel of `grpc` or `grpc.aio`."""

    def __init__(self, channel: Any) -> None:  # noqa: ANN401 (grpc's, or grpc.aio's)
        self.ual = STUBS["UalService"](channel)
        self._channel = channel
        self._others: dict[str, Any] = {}
        """Stubs of the other services, made when they are called first."""

    def method(self, call: Call[Any]) -> Any:  # noqa: ANN401 (its type depends on the method and on the channel)
        """Returns the gRPC method of a call."""
        return self.method_of(call.service, call.method)

    def method_of(self, service: str, method: str) -> Any:  # noqa: ANN401 (as above)
        """Returns the gRPC method of this name."""
        return getattr(self.ual if service == "UalService" else self._other(service), method)

    def _other(self, service: str) -> Any:  # noqa: ANN401 (as above)
        if service not in self._others:
            self._others[service] = STUBS[service](self._channel)
        return self._others[service]


@dataclass(slots=True, eq=False)
class Route:
    """A channel of `grpc` or `grpc.aio` to one address of the daemon.

    When the daemon has moved to another address, the channel is closed as soon as no call uses it: closing a channel
    ends its calls.
    """

    address: str
    channel: Any
    stubs: Stubs
    call_count: int = 0


class FollowedAddress(Protocol):
    """See `ual.network.followed.Followed`."""

    @property
    def is_settled(self) -> bool:
        """Whether the address can be requested."""

    @property
    def ns(self) -> str:
        """Its name; where none was given, that of the only one, once `address` was requested."""

    def address(self) -> str:
        """Returns where the UAV is now."""

    def close(self) -> None:
        """Leaves the network, where it was joined for this client."""


class DaemonTarget:
    """The daemon that a client talks to: at a fixed address, or where the network or this computer's registry says."""

    def __init__(
        self,
        ns: str | None,
        address: str | None,
        tls_ca: str | Path | None,
        credentials: Credentials | None = None,
        network: NetworkChoice | None = None,
    ) -> None:
        environment.require_known()
        self.ns = _name(ns) or environment.value(environment.NS_VARIABLE) or ""
        target: tuple[str | None, NetworkChoice | None] = environment.resolve_target(address, network)
        address, on = target
        self._fixed_address = None if address is None else _checked(address)
        self._shown = Credentials.from_environment() if credentials is None else _credentials(credentials)
        trusted = environment.value(environment.CA_VARIABLE) if tls_ca is None else tls_ca
        self._credentials = _read_tls(trusted, self._shown) if trusted else None
        self._followed = None if on is None else _follow(on, self.ns)
        self.lease_id = ""
        """The lease with which its commands are given; empty where it has none."""
        self._address: str | None = self._fixed_address
        self._signature: tuple[int, int] | None = None
        self._answered_ns = ""

    @property
    def metadata(self) -> tuple[tuple[str, str], ...]:
        """The metadata that every request carries."""
        metadata = self._shown.metadata(self._address or self.address(), has_tls=self._credentials is not None)
        if self.ns:
            metadata = ((NS_METADATA_KEY, self.ns), *metadata)
        return (*metadata, (LEASE_METADATA_KEY, self.lease_id)) if self.lease_id else metadata

    @property
    def known_ns(self) -> str:
        """The namespace as given, as registered on this computer, or as the daemon said last; else empty."""
        if not (self.ns or self._fixed_address):
            self.address()
        return self.shown_ns

    @property
    def shown_ns(self) -> str:
        """The namespace as far as it is known already; for `repr`, which looks nothing up."""
        return self.ns or self._answered_ns

    @property
    def is_settled(self) -> bool:
        """Whether `address` can be requested. Just after the network was joined, the UAV may not have been received."""
        return self._followed is None or self._followed.is_settled

    @property
    def is_followed(self) -> bool:
        """Whether it is found on the network."""
        return self._followed is not None

    def close(self) -> None:
        """Leaves the network, where it was joined for this client."""
        if self._followed is not None:
            self._followed.close()

    def settle(self) -> None:
        """Blocks until `address` can be requested: up to 3 s after the network was joined."""
        while not self.is_settled:
            time.sleep(SETTLING_S)

    def note_ns(self, ns: str) -> None:
        """Stores the namespace that the daemon says. Requests carry only one that was given."""
        self._answered_ns = ns

    def described(self, status: str) -> str:
        """Returns in words which UAV it is, where it is, and the status of the connection. Makes no call."""
        where = f"at {self._address}" if self._address else ""
        return f"{' '.join(filter(None, (self.shown_ns, where))) or 'the only UAV'}, {status}"

    def open_channel(self, api: Any, address: str, more_options: tuple[tuple[str, int], ...] = ()) -> Any:  # noqa: ANN401 (grpc or grpc.aio, and its channel)
        """Opens a channel to an address by `api`, which is the module `grpc` or `grpc.aio`."""
        if api is grpc:
            _gevent.prepare()
        else:
            _gevent.refuse_asyncio()
        options = (*CHANNEL_OPTIONS, *more_options)
        if self._credentials is None:
            return api.insecure_channel(address, options)
        return api.secure_channel(address, self._credentials, options)

    def address(self) -> str:
        """Returns where the daemon is now. Costs one `stat` of a file, so it can be called before each call.

        If the daemon is gone, returns where it was. If neither namespace nor address was given, this is the only daemon
        of this computer; from then on its namespace is used.
        """
        if self._fixed_address is not None:
            return self._fixed_address
        if self._followed is not None:
            self._address = self._followed.address()
            self.ns = self._followed.ns
            return self._address
        if not self.ns:
            daemon = discovery.only()
            if daemon is None:
                return discovery.default_address("")
            self.ns = daemon.ns
        signature = _signature(discovery.registry_file(self.ns))
        if self._address is None or (signature is not None and signature != self._signature):
            self._signature = signature
            registration = discovery.registered(self.ns)
            if registration is not None:
                self._address = registration.address
        return self._address or discovery.default_address(self.ns)


def _follow(network: NetworkChoice, ns: str) -> FollowedAddress:
    from ual.network import membership  # imported late: few clients need it

    return membership.follow(network, ns)


def _name(ns: str | None) -> str:
    """Accepts a name. An address in its place would be looked for as a name, at the default port of this computer."""
    if ns is not None and not isinstance(ns, str):
        raise InvalidArgumentError(f"ns: {ns!r} is no name; pass a text as 'uav_1'", {"field": "ns"})
    if ns and ":" in ns:
        raise InvalidArgumentError(f"ns: {ns!r} is an address; pass it as address={ns!r} (--address)", {"field": "ns"})
    return ns or ""


def _credentials(credentials: Credentials) -> Credentials:
    if not isinstance(credentials, Credentials):  # its value is secret, and is not shown
        raise InvalidArgumentError(
            f"credentials: they are of type {type(credentials).__name__}; pass ual.Credentials(token=...)",
            {"field": "credentials"},
        )
    return credentials


def _checked(address: str) -> str:
    if not isinstance(address, str) or not re.fullmatch(
        r"unix:.+|(\[[0-9A-Fa-f:.]+\]|[^\s:/\[\]]+):[0-9]{1,5}", address
    ):
        raise InvalidArgumentError(
            f"address: {address!r} is not an address; write HOST:PORT or unix:PATH", {"field": "address"}
        )
    port = address.rpartition(":")[2]
    if not address.startswith("unix:") and not 0 < int(port) <= discovery.LAST_PORT:
        # gRPC would go to this port modulo 65536, which may be another UAV's.
        raise InvalidArgumentError(
            f"address: the port of {address!r} is not from 1 to {discovery.LAST_PORT}", {"field": "address"}
        )
    return address


def _signature(file: Path) -> tuple[int, int] | None:
    try:
        stat = file.stat()
    except OSError:
        return None
    return stat.st_mtime_ns, stat.st_ino


def _read_tls(tls_ca: str | Path, shown: Credentials) -> grpc.ChannelCredentials:
    trusted = read(tls_ca, "tls_ca")
    if shown.tls_certificate is None or shown.tls_key is None:
        return grpc.ssl_channel_credentials(trusted)
    chain, key = read(shown.tls_certificate, "tls_certificate"), read(shown.tls_key, "tls_key")
    return grpc.ssl_channel_credentials(trusted, key, chain)
