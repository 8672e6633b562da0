"""Identifies callers: by a token, by a TLS certificate, or by the computer that the call comes from."""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import datetime, timezone
from functools import lru_cache
from typing import Protocol
from urllib.parse import unquote

from ual.access import tokens
from ual.access.roles import Role
from ual.access.tokens import Token
from ual.errors import UnauthenticatedError
from ual_daemon.server.access.caller import LOCAL, NOBODY, OF_THIS_COMPUTER, Caller
from ual_daemon.server.transport.base import ServedCall

AUTHORIZATION = "authorization"
FORWARDED_FOR = "x-forwarded-for"
"""Header in which a gateway on this computer names the address that a call came from."""
FORWARDED_NAME = "x-ual-certificate"
"""Header in which such a gateway gives the name of the certificate that it has verified."""
_BEARER = "bearer "


@dataclass(frozen=True, slots=True)
class Roles:
    """The file ``--roles``: the role of each certificate and each token, and of callers with neither."""

    certificates: Mapping[str, Role] = field(default_factory=dict)
    tokens: Mapping[str, Role] = field(default_factory=dict)
    local: Role = Role.COMMANDER
    nobody: Role = Role.NONE


_DEFAULT = Roles()


class KnownTokens(Protocol):
    """Value that is read when it is needed: `WatchedFile`."""

    @property
    def value(self) -> tuple[Token, ...]:
        """Tokens of the file now."""


class Access:
    """Identification of callers, and their roles. Any thread may call.

    Args:
        roles: Returns what the roles file says now.
        known_tokens: The tokens; None where the daemon knows none.
        now: The time, UTC.
    """

    def __init__(
        self,
        roles: Callable[[], Roles] = lambda: _DEFAULT,
        known_tokens: KnownTokens | None = None,
        now: Callable[[], datetime] = lambda: datetime.now(timezone.utc),
    ) -> None:
        self._roles = roles
        self._tokens = known_tokens
        self._now = now

    @property
    def needs_role(self) -> bool:
        """Whether a caller of another computer that shows nothing may not fly."""
        return self._roles().nobody < Role.PILOT

    def identify(self, call: ServedCall) -> Caller:
        """Returns the caller.

        Raises:
            UnauthenticatedError: The caller is not known here.

        """
        metadata = _metadata_of(call)
        roles, is_local = self._roles(), is_this_computer(call.peer())
        caller = None
        if AUTHORIZATION in metadata and (self._tokens is not None or not is_local):  # without tokens none is checked
            caller = self._by_token(metadata[AUTHORIZATION], roles)
        elif is_local and FORWARDED_FOR in metadata:
            caller = self._by_gateway(metadata, roles)
        elif (name := call.certificate_name()) is not None:
            caller = _by_certificate(name, roles)
        elif is_local:
            caller = OF_THIS_COMPUTER if roles.local is Role.COMMANDER else Caller(LOCAL, roles.local)
        else:
            caller = Caller(NOBODY, roles.nobody)
        if caller.role is Role.NONE:
            raise self._unknown()
        return caller

    def _by_token(self, token: str, roles: Roles) -> Caller:
        secret = token[len(_BEARER) :].strip() if token.lower().startswith(_BEARER) else ""
        found = tokens.find(() if self._tokens is None else self._tokens.value, secret)
        if found is None or found.has_expired(self._now()):
            raise UnauthenticatedError(
                "the token is not one of this daemon's, was revoked, or has expired", {"needed": "token"}
            )
        return Caller(found.name, roles.tokens.get(found.name, found.role), is_named=True)

    @staticmethod
    def _by_gateway(metadata: Mapping[str, str], roles: Roles) -> Caller:
        """Returns the caller behind a gateway of this computer: it is trusted with what any local program could do
        itself.
        """
        name = metadata.get(FORWARDED_NAME, "")
        if name and roles.local is Role.COMMANDER:
            return _by_certificate(name, roles)
        from_here = all(map(_is_loopback, metadata[FORWARDED_FOR].split(",")))
        return Caller(LOCAL, roles.local) if from_here else Caller(NOBODY, roles.nobody)

    @staticmethod
    def _unknown() -> UnauthenticatedError:
        return UnauthenticatedError(
            "this daemon wants to know who calls: show a token (metadata `authorization: Bearer ...`, --token-file, "
            "UAL_TOKEN) or a certificate (--tls-certificate, --tls-key) that it knows",
            {"needed": "token or certificate"},
        )


ANYBODY = Access(lambda: Roles(nobody=Role.COMMANDER))
"""Access for a trusted network (``--insecure`` without tokens and roles)."""


def _by_certificate(name: str, roles: Roles) -> Caller:
    return Caller(name, roles.certificates.get(name, Role.NONE), is_named=True)


def is_this_computer(peer: str) -> bool:
    """Returns whether a peer, as gRPC writes its address, is on this computer."""
    kind, _, rest = peer.partition(":")
    if kind not in ("ipv4", "ipv6"):
        return kind == "unix"
    return _is_loopback(re.sub(r"\[|\]", "", unquote(rest).rpartition(":")[0]))


@lru_cache(maxsize=1024)
def _is_loopback(text: str) -> bool:
    try:
        address = ipaddress.ip_address(text.strip().partition("%")[0])
    except ValueError:
        return False
    mapped = getattr(address, "ipv4_mapped", None)
    return address.is_loopback or (mapped is not None and mapped.is_loopback)


def _metadata_of(call: ServedCall) -> dict[str, str]:
    """Returns the metadata by which a caller identifies itself. A key that is sent twice counts with all its values."""
    found: dict[str, str] = {}
    for key, value in call.metadata:
        if key in (AUTHORIZATION, FORWARDED_FOR, FORWARDED_NAME) and isinstance(value, str):
            found[key] = f"{found[key]},{value}" if key in found else value
    return found
