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
from ual_daemon.backends.rosbridge.calls import PendingCalls, ServiceTimeoutError
from ual_daemon.backends.rosbridge.operations import Fragments, Message, OperationError
from ual_daemon.backends.rosbridge.websocket import BridgeTransport


class _CallConnection:
    """A connection, and the calls that have left on it and are not answered yet."""

    def __init__(self, transport: BridgeTransport) -> None:
        self.transport = transport
        self.fragments = Fragments()
        self.idents: set[str] = set()


class SlowCalls:
    """`call` is for any thread, the rest for the link's. It connects with the first call.

    A call that was withdrawn, or not answered in time, may hold up all that come after it. So these have a new
    connection. What is in progress on the old one goes on: a mission that is uploaded, for example.
    """

    def __init__(self, connect: Callable[[], BridgeTransport], now_s: Callable[[], float]) -> None:
        self._connect = connect
        self._now_s = now_s
        self._calls = PendingCalls()
        self._newest: _CallConnection | None = None
        """Connection on which calls leave."""
        self._connections: list[_CallConnection] = []
        """It, and those that have calls in progress."""
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
        self._drop_expired()
        try:
            self._send()
        except OSError as error:
            self._lose(self._newest, error)
        for each in list(self._connections):
            self._receive(each)

    def end(self, text: str) -> None:
        """Ends all calls: a connection is lost. `text` says why."""
        with self._lock:
            self._unsent.clear()
        for each in list(self._connections):
            self._close(each)
        self._calls.fail_all(text)

    def _send(self) -> None:
        while self._unsent:
            if self._newest is None:
                self._newest = _CallConnection(self._connect())
                self._connections.append(self._newest)
            with self._lock:
                waiting = self._unsent.popleft() if self._unsent else None
            if waiting is None:
                return
            ident, data = waiting
            if self._calls.is_open(ident):
                self._newest.idents.add(ident)
                self._newest.transport.send(data)
            else:
                self._calls.refuse(ident, "it was withdrawn")

    def _receive(self, connection: _CallConnection) -> None:
        """Takes what has come."""
        try:
            for data in connection.transport.receive(0.0):
                with contextlib.suppress(OperationError, KeyError, TypeError):  # the call then ends with its time
                    self._take(connection, operations.decode(data))
        except OSError as error:
            self._lose(connection, error)
        else:
            if connection is not self._newest and not connection.idents:
                self._close(connection)

    def _lose(self, connection: _CallConnection | None, error: OSError) -> None:
        """Ends the calls of a connection: they may have been executed. None: ends those that wait for one."""
        if connection is None:
            with self._lock:
                unsent, self._unsent = self._unsent, deque()
            for ident, _ in unsent:
                self._calls.refuse(ident, str(error))
            return
        self._close(connection)
        for ident in connection.idents:
            self._calls.refuse(ident, str(error), ServiceTimeoutError)

    def _take(self, connection: _CallConnection, operation: dict[str, object]) -> None:
        if operation["op"] == "service_response":
            connection.idents.discard(str(operation.get("id")))
            self._calls.answer(operation)
        elif operation["op"] == "fragment":
            whole = connection.fragments.add(operation)
            if whole is not None:
                self._take(connection, whole)

    def _drop_expired(self) -> None:
        """Ends the calls whose time is over. The connection on which one has left is not used for new ones."""
        late = set(self._calls.expire(self._now_s()))
        if not late:
            return
        with self._lock:
            self._unsent = deque(each for each in self._unsent if each[0] not in late)
        for each in list(self._connections):
            self._drop(each, late)

    def _drop(self, connection: _CallConnection, late: set[str]) -> None:
        if connection.idents.isdisjoint(late):
            return
        connection.idents -= late
        if not connection.idents:
            self._close(connection)
        elif connection is self._newest:
            self._newest = None

    def _close(self, connection: _CallConnection) -> None:
        if connection is self._newest:
            self._newest = None
        self._connections.remove(connection)
        connection.transport.abort()
