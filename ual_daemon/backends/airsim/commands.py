"""Executes commands one after another, on a thread and a connection of their own: each waits for its answers."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future

from ual.errors import LinkLostError, RejectedByAutopilotError
from ual_daemon import logs
from ual_daemon.backends import futures
from ual_daemon.backends.airsim.rpc import RemoteError, RpcCaller, RpcConnection, T
from ual_daemon.backends.airsim.settings import AirsimAddress

_log = logging.getLogger(__name__)

Action = Callable[[RpcCaller], None]
"""Executes one command. Raises RefusedError or RemoteError where the simulator refuses."""


class RefusedError(Exception):
    """The simulator refused a command; the message says why, human-readable."""


class _WithdrawnError(Exception):
    """A command was withdrawn between two of its calls."""


_DECIDING = ("enableApiControl", "armDisarm")
"""They are not called for a command that was withdrawn. The others are refused by the simulator where the API has no
control; and a vehicle that was given API control falls until its command has come."""


class _Calls:
    """The calls of one command."""

    def __init__(self, connection: RpcConnection, answer: Future[None]) -> None:
        self._connection = connection
        self._answer = answer
        self.post = connection.post

    def call(self, kind: type[T], timeout_s: float, method: str, *arguments: object) -> T:
        if method in _DECIDING and self._answer.cancelled():
            raise _WithdrawnError
        return self._connection.call(kind, timeout_s, method, *arguments)


class AirsimCommandQueue:
    """One thread that executes commands in their order."""

    def __init__(self, address: AirsimAddress, thread_name: str) -> None:
        self._address = address
        self._queue: queue.SimpleQueue[tuple[Action, Future[None]] | None] = queue.SimpleQueue()
        self._open = futures.OpenFutures()
        self._lock = threading.Lock()
        self._unfinished_count = 0
        self._connection: RpcConnection | None = None
        self._is_closed = False
        self._thread = threading.Thread(target=self._run, name=thread_name, daemon=True)

    @property
    def why_late(self) -> str:
        """Why a command would be executed late now, human-readable; empty if it would not."""
        return "the simulator still executes an earlier command" if self._unfinished_count else ""

    def open(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def submit(self, action: Action) -> Future[None]:
        """Executes a command as soon as those before it have ended.

        The future ends with None, with a RejectedByAutopilotError, or with a LinkLostError where an answer is lost.
        Cancelling it withdraws the command, also between two of its calls.
        """
        return self._open.give("command the simulator", lambda answer: self._add(action, answer))

    def _add(self, action: Action, answer: Future[None]) -> None:
        self._count(1)
        self._queue.put((action, answer))

    def close(self) -> None:
        """Ends the thread; the command that waits for its answer is given up."""
        self._is_closed = True
        self._queue.put(None)
        self.disconnect()
        if threading.current_thread() is self._thread:
            return
        if self._thread.is_alive():
            self._thread.join()
        self._open.close()

    def _run(self) -> None:
        while (submitted := self._queue.get()) is not None and not self._is_closed:
            action, answer = submitted
            error = None if answer.cancelled() else self._execute(action, answer)
            self._count(-1)
            futures.end(answer, error)
        self.disconnect()
        self._open.close()

    def _execute(self, action: Action, answer: Future[None]) -> Exception | None:
        """Returns why a command was not done; None if it was."""
        try:
            action(_Calls(self._connected(), answer))
        except (RefusedError, RemoteError) as error:
            text = str(error)
            return RejectedByAutopilotError(f"the simulator refused: {text}", {"text": text})
        except _WithdrawnError:
            return None  # nobody hears of it
        except (OSError, ValueError) as error:
            return self._lost(error)
        except Exception as error:  # noqa: BLE001  logged with its traceback; the next command is executed
            _log.exception("a command failed; this is a defect of UAL, please report it")
            return self._lost(error)
        return None

    def _lost(self, error: Exception) -> LinkLostError:
        """Makes the connection again: the answer is lost, and the command may have been executed."""
        self.disconnect()
        why = str(error) or repr(error)
        if not self._is_closed:
            logs.event(_log, logging.WARNING, "command_not_answered", why=why)
        return LinkLostError(f"the simulator has not answered: {why}")

    def _count(self, by: int) -> None:
        with self._lock:
            self._unfinished_count += by

    def _connected(self) -> RpcConnection:
        with self._lock:
            if self._connection is not None:
                return self._connection
        connection = RpcConnection(self._address)
        with self._lock:
            self._connection = connection
        return connection

    def disconnect(self) -> None:
        """Closes the connection, and drops what has not reached the simulator. The next use makes a new one."""
        with self._lock:
            connection, self._connection = self._connection, None
        if connection is not None:
            connection.abort()
