"""Executes commands one after another, on a thread and a connection of their own: each waits for its answer."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future

from ual.errors import RejectedByAutopilotError
from ual_daemon import logs
from ual_daemon.backends import futures
from ual_daemon.backends.airsim.rpc import Connection, RemoteError
from ual_daemon.backends.airsim.settings import Address

_log = logging.getLogger(__name__)

Action = Callable[[Connection], None]
"""Executes one command. Raises RefusedError or RemoteError where the simulator refuses."""


class RefusedError(Exception):
    """The simulator refused a command; the message says why, human-readable."""


class CommandQueue:
    """One thread that executes commands in their order."""

    def __init__(self, address: Address, thread_name: str) -> None:
        self._address = address
        self._queue: queue.SimpleQueue[tuple[Action, Future[None]] | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._connection: Connection | None = None
        self._is_closed = False
        self._thread = threading.Thread(target=self._run, name=thread_name, daemon=True)

    def open(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def submit(self, action: Action) -> Future[None]:
        """Executes a command as soon as those before it have ended.

        The future ends with None, or with a RejectedByAutopilotError. It stays open where the answer is lost.
        """
        answer: Future[None] = Future()
        self._queue.put((action, answer))
        return answer

    def close(self) -> None:
        """Ends the thread; the command that waits for its answer is given up."""
        self._is_closed = True
        self._queue.put(None)
        self.disconnect()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join()

    def _run(self) -> None:
        while (item := self._queue.get()) is not None and not self._is_closed:
            action, answer = item
            if not answer.cancelled():
                self._execute(action, answer)
        self.disconnect()

    def _execute(self, action: Action, answer: Future[None]) -> None:
        try:
            action(self._connected())
        except (RefusedError, RemoteError) as error:
            text = str(error)
            futures.end(answer, RejectedByAutopilotError(f"the simulator refused: {text}", {"text": text}))
        except (OSError, ValueError) as error:  # the answer is lost
            self.disconnect()
            if not self._is_closed:
                logs.event(_log, logging.WARNING, "command_not_answered", why=str(error) or repr(error))
        else:
            futures.end(answer)

    def _connected(self) -> Connection:
        with self._lock:
            if self._connection is not None:
                return self._connection
        connection = Connection(self._address)
        with self._lock:
            self._connection = connection
        return connection

    def disconnect(self) -> None:
        """Closes the connection; the next use makes a new one."""
        with self._lock:
            connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()
