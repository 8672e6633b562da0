"""Corrections of satellites to a MAVLink autopilot: they leave on the thread that receives."""

from __future__ import annotations

from collections.abc import Callable

from typing_extensions import override

from ual.errors import UalError
from ual_daemon.backends.mavlink.session.discovery import Discovery
from ual_daemon.backends.mavlink.session.session import MavlinkSession
from ual_daemon.backends.offers.corrections import AutopilotCorrections, Injected


class MavlinkCorrections(AutopilotCorrections):
    """The corrections of one backend.

    Args:
        reach: Returns the session that is in reach, or why none is.
        post: Has something done on the thread that receives.
        discovery: Returns what keeps the protocols; None before there is a link.
        clock: Returns the time.

    """

    def __init__(
        self,
        access: Callable[[str], MavlinkSession | UalError],
        post: Callable[[Callable[[Discovery], None]], None],
        discovery: Callable[[], Discovery | None],
        clock: Callable[[], float],
    ) -> None:
        super().__init__()
        self._access = access
        self._post = post
        self._discovery = discovery
        self._clock = clock

    @override
    def inject(self, message: bytes) -> None:
        session = self._access("send corrections")
        if isinstance(session, UalError):
            self._post(lambda discovery: discovery.protocols.corrections.refuse(session.message))
        else:
            self._post(lambda discovery: discovery.protocols.corrections.give(message))

    @override
    def injected(self) -> Injected:
        discovery = self._discovery()
        return Injected() if discovery is None else discovery.protocols.corrections.counts

    @override
    def now_s(self) -> float:
        return self._clock()
