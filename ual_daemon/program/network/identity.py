"""Name in the network's certificate: routers pass a UAV's messages by it, and silently drop all others.

The certificate is shown to the authority here, as a router would see it: by a handshake in memory.
"""

from __future__ import annotations

import ssl
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ual_daemon.settings import ConfigError

if TYPE_CHECKING:
    from ual.network.settings import NetworkSettings

_NO_CHECK_TIME = ssl.VerifyFlags(0x200000)
"""OpenSSL's X509_V_FLAG_NO_CHECK_TIME: a field computer may not know the date yet when its daemon starts."""
_MOST_FLIGHTS = 8
"""Of a handshake, in which each side waits for the other's words; three are enough."""


def require(settings: NetworkSettings, publisher: str) -> None:
    """Refuses a certificate by which nothing that this daemon tells would reach the network.

    Raises:
        ConfigError: It has another name than the UAVs that are told of, or others will not take it.

    """
    name = _name(settings)
    if name != publisher:
        raise ConfigError(
            f"{settings.certificate} is the certificate of {name}, but this daemon tells of {publisher}: the network "
            f"would drop all that it tells. Make one by `ual certificates daemon {publisher}`, and name it to the "
            f"routers by `ual certificates network` with `--uav {publisher}`",
            "network",
        )


def _name(settings: NetworkSettings) -> str:
    """Returns the name in the certificate, as the accepting end reads it."""
    router = _context(ssl.PROTOCOL_TLS_SERVER, settings)
    router.load_verify_locations(str(settings.authority))
    router.verify_mode = ssl.CERT_REQUIRED
    router.verify_flags |= _NO_CHECK_TIME
    member = _context(ssl.PROTOCOL_TLS_CLIENT, settings)
    member.check_hostname, member.verify_mode = False, ssl.CERT_NONE  # only the member's certificate is looked at
    there, here = ssl.MemoryBIO(), ssl.MemoryBIO()
    accepting, showing = router.wrap_bio(there, here, server_side=True), member.wrap_bio(here, there)
    try:
        _shake_hands((showing, accepting))
    except ssl.SSLError as error:
        why = error.verify_message if isinstance(error, ssl.SSLCertVerificationError) else error.reason
        raise ConfigError(
            f"{settings.authority} does not vouch for {settings.certificate} as a member of the network "
            f"({why}): make it anew by `ual certificates daemon`",
            "network",
        ) from None
    shown = accepting.getpeercert() or {}
    subject: Sequence[Sequence[tuple[str, str]]] = shown.get("subject", ())  # type: ignore[assignment]  # as documented
    return next((value for part in subject for name, value in part if name == "commonName"), "no name")


def _context(protocol: int, settings: NetworkSettings) -> ssl.SSLContext:
    context = ssl.SSLContext(protocol)
    context.load_cert_chain(str(settings.certificate), str(settings.key))
    return context


def _shake_hands(sides: Sequence[ssl.SSLObject]) -> None:
    for _ in range(_MOST_FLIGHTS):
        sides = [each for each in sides if not _has_finished(each)]
        if not sides:
            return
    raise AssertionError("a handshake in memory does not end")


def _has_finished(side: ssl.SSLObject) -> bool:
    try:
        side.do_handshake()
    except ssl.SSLWantReadError:
        return False
    return True
