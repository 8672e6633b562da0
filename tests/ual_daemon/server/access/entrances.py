"""A served UAV, and every entrance to it: the origin of a caller, and its credentials."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from datetime import datetime, timedelta, timezone
from pathlib import Path

import grpc
import grpc.aio
import pytest

from ual.access import tokens
from ual.access.roles import Role
from ual.shared import whole_file
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.light import LightBackend
from ual_daemon.program import access_files
from ual_daemon.program.configuration import DaemonSettings
from ual_daemon.server import addresses, tls
from ual_daemon.server.server import Server
from ual_daemon.server.transport import selection
from ual_daemon.vehicle.vehicle import Vehicle
from ual_tools.access import certificates

ROLES = """
certificates:
  observer: observer
  pilot: pilot
  commander: commander
  revoked: none
tokens:
  lowered: observer
"""


def beyond_loopback() -> str:
    """An address of this computer at which others reach it, as far as a server can see."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # sends nothing
        except OSError:
            pytest.skip("NO ADDRESS BEYOND LOOPBACK, callers from other computers are NOT TESTED")
        host: str = probe.getsockname()[0]
    if host.startswith("127."):
        pytest.skip("NO ADDRESS BEYOND LOOPBACK, callers from other computers are NOT TESTED")
    return host


@dataclass(frozen=True)
class Variant:
    """One way in. `role` is what the caller may do; None where it does not even get a connection."""

    role: Role | None
    kind: str = "tls"
    """plain (loopback), unix, tls (beyond loopback) or mutual (the same, the daemon wants certificates)."""
    token: str | None = None
    certificate: str | None = None
    metadata: tuple[tuple[str, str], ...] = ()


def variants(made: Made) -> dict[str, Variant]:
    """Every way in, by name."""
    forwarded = ("x-forwarded-for", "203.0.113.7")
    return {
        "loopback": Variant(Role.COMMANDER, "plain"),
        "unix socket": Variant(Role.COMMANDER, "unix"),
        "loopback, token of a pilot": Variant(Role.PILOT, "plain", made.tokens["pilot"]),
        "loopback, wrong token": Variant(Role.NONE, "plain", "ual_wrong"),
        "gateway, nobody": Variant(Role.NONE, "plain", metadata=(forwarded,)),
        "gateway, token of an observer": Variant(
            Role.OBSERVER, "plain", made.tokens["observer"], metadata=(forwarded,)
        ),
        "gateway, certificate": Variant(Role.PILOT, "plain", metadata=(forwarded, ("x-ual-certificate", "pilot"))),
        "gateway, unknown certificate": Variant(Role.NONE, "plain", metadata=(forwarded, ("x-ual-certificate", "who"))),
        "gateway, from this computer": Variant(Role.COMMANDER, "plain", metadata=(("x-forwarded-for", "127.0.0.1"),)),
        "tls, nothing": Variant(Role.NONE),
        "tls, as if forwarded from the daemon's computer": Variant(
            Role.NONE, metadata=(("x-forwarded-for", "127.0.0.1"),)
        ),
        "tls, as if by a gateway": Variant(Role.NONE, metadata=(forwarded, ("x-ual-certificate", "commander"))),
        "tls, token of an observer": Variant(Role.OBSERVER, token=made.tokens["observer"]),
        "tls, token of a pilot": Variant(Role.PILOT, token=made.tokens["pilot"]),
        "tls, token of a commander": Variant(Role.COMMANDER, token=made.tokens["commander"]),
        "tls, token that the roles file lowers": Variant(Role.OBSERVER, token=made.tokens["lowered"]),
        "tls, expired token": Variant(Role.NONE, token=made.tokens["expired"]),
        "tls, revoked token": Variant(Role.NONE, token=made.tokens["revoked"]),
        "tls, no scheme before the token": Variant(Role.NONE, metadata=(("authorization", made.tokens["pilot"]),)),
        "mutual tls, no certificate": Variant(None, "mutual"),
        "mutual tls, observer": Variant(Role.OBSERVER, "mutual", certificate="observer"),
        "mutual tls, pilot": Variant(Role.PILOT, "mutual", certificate="pilot"),
        "mutual tls, commander": Variant(Role.COMMANDER, "mutual", certificate="commander"),
        "mutual tls, revoked": Variant(Role.NONE, "mutual", certificate="revoked"),
        "mutual tls, not in the roles file": Variant(Role.NONE, "mutual", certificate="unknown"),
        "mutual tls, expired": Variant(None, "mutual", certificate="expired"),
        "mutual tls, another authority": Variant(None, "mutual", certificate="other/commander"),
        "mutual tls, pilot with the token of an observer": Variant(
            Role.OBSERVER, "mutual", made.tokens["observer"], "pilot"
        ),
    }


@dataclass(frozen=True)
class Made:
    """The files of a team, and the tokens by name."""

    directory: Path
    tokens: Mapping[str, str]

    @property
    def authority(self) -> Path:
        return certificates.files(self.directory, certificates.AUTHORITY).certificate


def make_files(directory: Path, host: str) -> Made:
    """Makes a team's certificates, tokens and roles."""
    certificates.make_authority(directory, "team", 10.0)
    certificates.make_daemon(directory, "uav_1", [host, "127.0.0.1"], 10.0)
    for name in ("observer", "pilot", "commander", "revoked", "unknown"):
        certificates.make_caller(directory, name, 10.0)
    certificates.make_caller(directory, "expired", -0.1)
    certificates.make_authority(directory / "other", "others", 10.0)
    certificates.make_caller(directory / "other", "commander", 10.0)
    whole_file.create(directory / "roles.yaml", ROLES.encode())
    now = datetime.now(timezone.utc)
    made = {
        "observer": tokens.make("observer", Role.OBSERVER, None, now),
        "pilot": tokens.make("pilot", Role.PILOT, now + timedelta(days=1), now),
        "commander": tokens.make("commander", Role.COMMANDER, None, now),
        "lowered": tokens.make("lowered", Role.COMMANDER, None, now),
        "expired": tokens.make("expired", Role.COMMANDER, now - timedelta(seconds=1), now),
        "revoked": tokens.make("revoked", Role.COMMANDER, None, now),
    }
    stored = [token for name, (_, token) in made.items() if name != "revoked"]
    whole_file.create(directory / "tokens.json", tokens.write(stored))
    return Made(directory, {name: secret for name, (secret, _) in made.items()})


@dataclass(frozen=True)
class Served:
    """Addresses of a served UAV, by the kind of a way in."""

    addresses: Mapping[str, str]
    made: Made

    def channel(self, way: Variant) -> grpc.aio.Channel:
        """A channel of a way in, for asyncio."""
        credentials = self._credentials(way)
        address = self.addresses[way.kind]
        if credentials is None:
            return grpc.aio.insecure_channel(address)
        return grpc.aio.secure_channel(address, credentials)

    def blocking_channel(self, way: Variant) -> grpc.Channel:
        """The same, for threads."""
        credentials = self._credentials(way)
        address = self.addresses[way.kind]
        return grpc.insecure_channel(address) if credentials is None else grpc.secure_channel(address, credentials)

    def _credentials(self, way: Variant) -> grpc.ChannelCredentials | None:
        if way.kind in ("plain", "unix"):
            return None
        trusted = self.made.authority.read_bytes()
        if way.certificate is None:
            return grpc.ssl_channel_credentials(trusted)
        shown = certificates.files(self.made.directory, way.certificate)
        return grpc.ssl_channel_credentials(trusted, shown.key.read_bytes(), shown.certificate.read_bytes())

    @staticmethod
    def metadata(way: Variant) -> tuple[tuple[str, str], ...]:
        """Returns the metadata of calls by a way in."""
        return way.metadata if way.token is None else (*way.metadata, ("authorization", f"Bearer {way.token}"))


@asynccontextmanager
async def served(made: Made, host: str, choice: selection.Choice) -> AsyncIterator[Served]:
    """Serves a light UAV on loopback, on a unix socket, and by TLS beyond loopback."""
    directory = made.directory
    pair = certificates.files(directory, "uav_1")
    settings = DaemonSettings(tokens=str(directory / "tokens.json"), roles=str(directory / "roles.yaml"))
    access = access_files.access(settings)
    vehicle = Vehicle(LightBackend(BackendOptions("uav_1")))
    transport = await selection.choose(choice)
    servers = {kind: Server(vehicle, transport, access=access) for kind in ("plain", "tls", "mutual")}
    plain = tls.credentials(str(pair.certificate), str(pair.key))
    mutual = tls.credentials(str(pair.certificate), str(pair.key), str(made.authority))
    socket_path = f"unix:{directory}/uav.sock"
    try:
        near = servers["plain"].listen([addresses.parse("127.0.0.1:0"), addresses.parse(socket_path)])
        far = servers["tls"].listen([addresses.parse(f"{host}:0")], plain)
        strict = servers["mutual"].listen([addresses.parse(f"{host}:0")], mutual)
        for server in servers.values():
            await server.start()
        vehicle.open()
        where = {"plain": str(near[0]), "unix": socket_path, "tls": str(far[0]), "mutual": str(strict[0])}
        yield Served(where, made)
    finally:
        for server in servers.values():
            server.begin_shutdown()
        await asyncio.gather(*(server.stop() for server in servers.values()))
        transport.close()
        vehicle.close()
