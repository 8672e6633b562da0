"""Services that may take long to answer, on a connection of their own.

With ROS 2 rosbridge executes the operations of a client one after another, so what flies would wait behind such a call.
"""

from __future__ import annotations

import contextlib
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future

from ual_daemon.backends.rosbridge import operations
from ual_daemon.backends.rosbridge.calls import Calls
from ual_daemon.backends.rosbridge.operations import Fragments, Message, OperationError
from ual_daemon.backends.rosbridge.websocket import Transport


class SlowCalls:
    """`call` is for any thread, the rest for the link's. It connects with the first call.

    A call that was not answered in time may hold up all that come after it, so the connection is then made anew.
    """

    def __init__(self, connect: Callable[[], Transport], now_s: Callable[[], float]) -> None:
        self._connect = connect
        self._now_s = now_s
        self._calls = Calls()
        self._transport: Transport | None = None
        self._fragments = Fragments()
        self._unsent: deque[tuple[str, bytes]] = deque()
        self._lock = threading.Lock()

    def call(self, service: str, arguments: Message, timeout_s: float) -> Future[Message]:
        """Calls a service; see `RosbridgeLink.call_service`."""
        ident, answer = self._calls.begin(service, self._now_s(), timeout_s)
        with self._lock:
            self._unsent.append((ident, operations.call_service(service, arguments, ident, timeout_s)))
        return answer

    def serve(self) -> None:
        """Sends what waits, and takes what has come. What was withdrawn, or has waited for too long, does not leave."""
        if self._drop_expired():
            self._close()
            self._calls.fail_all("an earlier call was not answered")
        try:
            self._send()
            self._receive()
        except OSError as error:
            self.end(str(error))

    def end(self, text: str) -> None:
        """Ends all calls: a connection is lost. `text` says why."""
        with self._lock:
            self._unsent.clear()
        self._close()
        self._calls.fail_all(text)

    def _send(self) -> None:
        while self._unsent:
            if self._transport is None:
                self._transport, self._fragments = self._connect(), Fragments()
            with self._lock:
                waiting = self._unsent.popleft() if self._unsent else None
            if waiting is None:
                return
            ident, data = waiting
            if self._calls.is_open(ident):
                self._transport.send(data)
            else:
                self._calls.refuse(ident, "it was withdrawn")

    def _receive(self) -> None:
        for data in () if self._transport is None else self._transport.receive(0.0):
            with contextlib.suppress(OperationError, KeyError, TypeError):  # the call then ends with its time
                self._take(operations.decode(data))

    def _take(self, operation: dict[str, object]) -> None:
        if operation["op"] == "service_response":
            self._calls.answer(operation)
        elif operation["op"] == "fragment":
            whole = self._fragments.add(operation)
            if whole is not None:
                self._take(whole)

    def _drop_expired(self) -> bool:
        """Ends the calls whose time is over. Returns whether one of them has left."""
        late = set(self._calls.expire(self._now_s()))
        with self._lock:
            kept = deque(each for each in self._unsent if each[0] not in late)
            unsent_count, self._unsent = len(self._unsent) - len(kept), kept
        return len(late) > unsent_count

    def _close(self) -> None:
        transport, self._transport = self._transport, None
        if transport is not None:
            transport.abort()
