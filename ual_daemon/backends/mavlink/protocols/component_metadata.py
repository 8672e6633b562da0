"""Location of the autopilot's metadata: COMPONENT_METADATA, which has to be requested.

https://mavlink.io/en/services/component_information.html
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import NamedTuple

from typing_extensions import override

from ual.errors import LinkLostError, UalTimeoutError
from ual_daemon.backends import futures
from ual_daemon.backends.mavlink.dialects.command_long import request_message
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.protocols.exchange import Exchange
from ual_daemon.backends.mavlink.protocols.protocol import Handler, Protocol
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink

RETRY_S = 0.6
TRIES_COUNT = 6
_ID = mavlink.MAVLINK_MSG_ID_COMPONENT_METADATA


class MetadataFile(NamedTuple):
    """Location of the general file, and its checksum."""

    uri: str
    crc: int


class _Request(Exchange[MetadataFile]):
    def __init__(self, future: Future[MetadataFile], send: Callable[[], object]) -> None:
        super().__init__(future)
        self._send = send
        self._tries_count = 0
        self._next_s = 0.0

    @override
    def tick(self, now_s: float) -> None:
        if now_s < self._next_s and self._tries_count:
            return
        if self._tries_count >= TRIES_COUNT:
            self.fail(UalTimeoutError("the autopilot does not tell where the descriptions of its parameters are"))
            return
        self._tries_count += 1
        self._next_s = now_s + RETRY_S
        self._send()

    def on_address(self, address: MetadataFile) -> None:
        """Takes the answer."""
        self._end(address)


class ComponentMetadata(Protocol):
    """Belongs to the thread that receives. All callers during the request get one answer each, in turn."""

    def __init__(self, send: Callable[[Message], object]) -> None:
        self.is_waiting = False
        self._send = send
        self._target: MessageSource | None = None
        self._running: list[_Request] = []

    @property
    @override
    def handlers(self) -> dict[int, Handler]:
        return {_ID: lambda message, _: self.on_message(message)}

    @override
    def attach(self, target: MessageSource, dialect: Dialect) -> None:
        self.drop("another autopilot was found")
        self._target = target

    @override
    def drop(self, why: str) -> None:
        for each in self._running:
            each.fail(LinkLostError(f"its descriptions were not read: {why}"))
        self._running.clear()

    @override
    def tick(self, now_s: float) -> None:
        self._running = [each for each in self._running if not each.is_over]
        for each in self._running:
            each.tick(now_s)

    def request(self, future: Future[MetadataFile]) -> None:
        """Asks where it is."""
        target = self._target
        if target is None:
            futures.fail(future, LinkLostError("no autopilot was found"))
            return
        message = request_message(_ID).request.encode(target, 0)
        self._running.append(_Request(future, lambda: self._send(message)))
        self.is_waiting = True

    def on_message(self, message: Message) -> None:
        """Takes a COMPONENT_METADATA."""
        for each in self._running:
            each.on_address(MetadataFile(message.uri, message.file_crc))
