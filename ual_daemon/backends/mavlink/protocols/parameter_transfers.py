"""The exchanges of parameters with the autopilot, in order. They outlive the session with it, so that each ends."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any

from typing_extensions import override

from ual.errors import (
    InvalidArgumentError,
    LinkLostError,
    NotSupportedError,
    RejectedByAutopilotError,
    ResourceExhaustedError,
    UalError,
    UalTimeoutError,
)
from ual.parameters.values import SYSTEM_ID_NAMES, Parameter
from ual_daemon.backends import futures
from ual_daemon.backends.firmwares.parameter_errors import unknown
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.dialects.parameter_codec import ParameterCodec
from ual_daemon.backends.mavlink.protocols.parameter_exchanges import (
    Listing,
    ParameterExchange,
    ParameterReading,
    ParameterRequests,
    Received,
    Writing,
)
from ual_daemon.backends.mavlink.protocols.protocol import Handler, Protocol
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink, member_name
from ual_daemon.backends.offers.parameters import Refusal

LONGEST_NAME_CHARACTERS = 16
_VALUE_BYTES = 4
"""The value comes first in a PARAM_VALUE."""
MOST_WAITING_EXCHANGES = 100
"""Exchanges that may wait for their turn."""


class ParameterTransfers(Protocol):
    """Belongs to the thread that receives. `send` sends a message; `is_up` says whether the link is up at a time.

    One exchange about a single parameter runs at a time, in the order in which they were requested. So two writes of
    one name cannot be taken for each other. A list runs at the same time, once for all callers.
    """

    def __init__(self, send: Callable[[Message], object], is_up: Callable[[float], bool]) -> None:
        self.is_waiting = False
        self._send = send
        self._is_up = is_up
        self._requests: ParameterRequests | None = None
        self._codec: ParameterCodec | None = None
        self._name = ""
        self._names: frozenset[str] = frozenset()
        """Names of the last list; empty while there was none."""
        self._waiting: deque[ParameterExchange[Parameter]] = deque()
        self._single: ParameterExchange[Parameter] | None = None
        self._listing: Listing | None = None
        self._listeners: list[Future[list[Parameter]]] = []
        self._new_id: int | None = None
        """The system that the autopilot becomes by what was written last: at once, or at its next boot."""

    @property
    @override
    def handlers(self) -> dict[int, Handler]:
        return {
            mavlink.MAVLINK_MSG_ID_PARAM_VALUE: self.on_value,
            mavlink.MAVLINK_MSG_ID_PARAM_ERROR: lambda message, _: self.on_error(message),
        }

    @override
    def attach(self, target: MessageSource, dialect: Dialect) -> None:
        followed = (
            self._single if isinstance(self._single, Writing) and self._is_successor(target, self._single) else None
        )
        if followed is not None:
            self._single = None
        self.drop("another autopilot was found")
        self._new_id = None
        self._codec, self._name, self._names = dialect.parameter_codec, dialect.name, frozenset()
        self._requests = ParameterRequests(
            lambda name: self._send(mavlink.MAVLink_param_request_read_message(*target, name.encode("ascii"), -1)),
            lambda index: self._send(mavlink.MAVLink_param_request_read_message(*target, b"", index)),
            lambda: self._send(mavlink.MAVLink_param_request_list_message(*target)),
            partial(self._write, target),
            self._explain,
        )
        if followed is not None:
            followed.follow(self._requests)
            self._single = followed

    def becomes(self, system_id: int) -> bool:
        """Returns whether the autopilot becomes this system by a value that UAL has written."""
        return system_id == self._new_id

    @staticmethod
    def _is_successor(target: MessageSource, writing: Writing) -> bool:
        wanted = writing.wanted
        return not writing.is_over and wanted.name in SYSTEM_ID_NAMES and wanted.value == target.system_id

    @override
    def drop(self, why: str) -> None:
        error = LinkLostError(f"its parameters were not exchanged: {why}")
        for exchange in (*self._waiting, *self._running):
            exchange.fail(error)
        self._waiting.clear()
        self._single = self._listing = None

    # --- What is requested --------------------------------------------------------------------------------------------

    def read(self, name: str, future: Future[Parameter]) -> None:
        """Reads one parameter."""
        self._add(future, name, lambda requests: ParameterReading(future, requests, name))

    def write(self, wanted: Parameter, refusal: Refusal, future: Future[Parameter]) -> None:
        """Writes one parameter, and reads it back; see `AutopilotParameters.write`."""
        try:
            if self._codec is not None:
                self._codec.encode(wanted)  # so that it is refused here, and not when it is its turn
        except InvalidArgumentError as error:
            futures.fail(future, error)
            return
        self._add(future, wanted.name, lambda requests: Writing(future, requests, wanted, refusal))

    def read_all(self, future: Future[list[Parameter]]) -> None:
        """Lists all, or waits for the list that is in progress."""
        requests = self._usable(future)
        if requests is None:
            return
        if self._listing is None:
            listed: Future[list[Parameter]] = Future()
            listed.add_done_callback(self._on_listed)
            self._listing = Listing(listed, requests)
        self._listeners.append(future)

    def note_names(self, names: frozenset[str]) -> None:
        """Takes the names of all, which were listed in another way."""
        self._names = names

    def _add(
        self, future: Future[Parameter], name: str, make: Callable[[ParameterRequests], ParameterExchange[Parameter]]
    ) -> None:
        requests = self._usable(future)
        if requests is None:
            return
        if len(name) > LONGEST_NAME_CHARACTERS or not name.isascii():
            text = f"name: {name!r:.80} is none that MAVLink has: they have up to {LONGEST_NAME_CHARACTERS} letters"
            futures.fail(future, InvalidArgumentError(text, {"field": "name"}))
            return
        if len(self._waiting) >= MOST_WAITING_EXCHANGES:
            text = f"{MOST_WAITING_EXCHANGES} reads and writes of parameters wait already, which is the limit"
            futures.fail(future, ResourceExhaustedError(text, {"limit": str(MOST_WAITING_EXCHANGES)}))
            return
        self._waiting.append(make(requests))

    def _usable(self, future: Future[Parameter] | Future[list[Parameter]]) -> ParameterRequests | None:
        """Returns what sends requests. Ends the future where there is nothing to send to."""
        if self._requests is None:
            futures.fail(future, LinkLostError("no autopilot was found"))
        elif self._codec is None:
            futures.fail(future, NotSupportedError(f"UAL does not read or write the parameters of {self._name}"))
        else:
            self.is_waiting = True
            return self._requests
        return None

    # --- What comes ---------------------------------------------------------------------------------------------------

    @override
    def tick(self, now_s: float) -> None:
        self._next_single()
        if self._single is not None:
            self._single.tick(now_s)
        if self._listing is not None:
            self._tick_listing(self._listing, now_s)
        self.is_waiting = bool(self._running or self._waiting)

    def on_value(self, message: Message, now_s: float) -> None:
        """Takes a PARAM_VALUE."""
        if self._codec is None or not self._running:
            return
        came = getattr(message, "content", b"")[:_VALUE_BYTES]
        value = self._codec.decode(message.param_value, message.param_type, came)
        received = Received(message.param_id, message.param_index, message.param_count, value)
        for exchange in self._running:
            exchange.on_value(received, now_s)

    def on_error(self, message: Message) -> None:
        """Takes a PARAM_ERROR: why a read or a write is refused."""
        if self._single is not None:
            self._single.on_refusal(message.param_id, _refusal(message.param_id, message.error))

    @property
    def _running(self) -> list[ParameterExchange[Any]]:
        return [each for each in (self._single, self._listing) if each is not None]

    def _next_single(self) -> None:
        while self._single is None or self._single.is_over:
            if not self._waiting:
                self._single = None
                return
            self._single = self._waiting.popleft()

    def _tick_listing(self, listing: Listing, now_s: float) -> None:
        if all(listener.cancelled() for listener in self._listeners):
            self._listing = None
            self._listeners.clear()
        else:
            listing.tick(now_s)

    def _on_listed(self, listed: Future[list[Parameter]]) -> None:
        self._listing, listeners, self._listeners = None, self._listeners, []
        error = listed.exception()
        if error is None:
            self._names = frozenset(each.name for each in listed.result())
        for listener in listeners:
            if error is not None:
                futures.fail(listener, error)
            elif listener.set_running_or_notify_cancel():
                listener.set_result(list(listed.result()))

    def _explain(self, error: UalError, name: str, now_s: float) -> UalError:
        """Returns what it means that a name was not answered: the link is lost, or it is known not to be there."""
        if not isinstance(error, UalTimeoutError):
            return error
        if not self._is_up(now_s):
            return LinkLostError(f"{error.message}; nothing comes from the autopilot", error.metadata)
        if name and self._names and name not in self._names:
            return unknown(name, self._names)
        return error

    def _write(self, target: MessageSource, wanted: Parameter) -> None:
        if self._codec is None:
            return
        if wanted.name in SYSTEM_ID_NAMES:
            self._new_id = int(wanted.value)
        field, kind = self._codec.encode(wanted), wanted.type.value
        self._send(mavlink.MAVLink_param_set_message(*target, wanted.name.encode("ascii"), field, kind))


def _refusal(name: str, number: int) -> UalError:
    if number == mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST:
        return unknown(name, frozenset())
    words = member_name("MAV_PARAM_ERROR", number) or f"error {number}"
    return RejectedByAutopilotError(f"{name}: the autopilot answers {words}", {"name": name, "result": words})
