"""The protocols about files and logs, on one stepped clock with a simulated autopilot's servers, over a bad link."""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar, cast

from tests.simulators.channel import Channel
from tests.simulators.codec import received
from tests.simulators.files import FileStore
from tests.simulators.mission_store import Sender
from ual.errors import UalError
from ual_daemon.backends.mavlink.dialects.ardupilot import ArduCopter
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.protocols.ftp import Ftp, Steps
from ual_daemon.backends.mavlink.protocols.log_transfers import LogTransfers
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message

T = TypeVar("T")
STEP_S = 0.01
HERE = (1, 191)


class Served:
    """`loss` of the messages are lost each way, `doubled` come twice, `late` come up to 0.3 s later."""

    def __init__(
        self, *, is_px4: bool = True, loss: float = 0.0, doubled: float = 0.0, late: float = 0.0, seed: int = 1
    ) -> None:
        self.now_s = 100.0
        self.is_up = True
        self.is_armed = False
        self.store = FileStore(is_px4=is_px4, is_armed=lambda: self.is_armed)
        self.ftp = Ftp(self._up, lambda _: self.is_up, lambda: self.is_armed)
        self.logs = LogTransfers(self._up, lambda _: self.is_up, lambda: self.is_armed)
        self.received: list[tuple[float, Message]] = []
        """Messages of the autopilot, with their times."""
        self.spoil: Callable[[Message], Message | None] = lambda message: message
        """Function that alters a message of the autopilot."""
        self._loss, self._doubled, self._late = loss, doubled, late
        self._noise = random.Random(seed)
        self._under_way: list[tuple[float, int, Callable[[], None]]] = []
        self._count = 0
        self._handlers = {**self.ftp.handlers, **self.logs.handlers}
        self._server = self.store.handlers()
        self._sender = Sender(cast("Channel", _Down(self._down)), *HERE)
        for each in (self.ftp, self.logs):
            each.attach(MessageSource(1, 1), Px4() if is_px4 else ArduCopter())

    def step(self) -> None:
        """A hundredth of a second passes."""
        self.now_s += STEP_S
        self.store.step(self.now_s)
        due = deque(sorted(each for each in self._under_way if each[0] <= self.now_s))
        self._under_way = [each for each in self._under_way if each[0] > self.now_s]
        while due:
            due.popleft()[2]()
        self.ftp.tick(self.now_s)
        self.logs.tick(self.now_s)

    def run(self, duration_s: float) -> None:
        for _ in range(round(duration_s / STEP_S)):
            self.step()

    def finished(self, future: Future[T], limit_s: float = 300.0) -> T:
        """Waits for a future. Raises the error that it ends with."""
        end_s = self.now_s + limit_s
        while not future.done():
            assert self.now_s < end_s, "it does not end"
            self.step()
        return future.result(0)

    def done(self, steps: Steps[T], limit_s: float = 300.0) -> T:
        """Has an exchange about files done."""
        future: Future[T] = Future()
        self.ftp.run(future, steps)
        return self.finished(future, limit_s)

    def bytes_received(self, since_s: float) -> int:
        """Returns the bytes of files that have come since then."""
        return sum(
            239 for at_s, each in self.received if at_s >= since_s and each.get_type() == "FILE_TRANSFER_PROTOCOL"
        )

    def _up(self, message: Message) -> None:
        sent = received(message)
        self._carry(lambda: self._server[sent.get_msgId()](sent, self._sender, self.now_s))

    def _down(self, message: Message, _now_s: float) -> None:
        sent = self.spoil(received(message))
        if sent is not None:
            self._carry(lambda: self._arrive(sent))

    def _arrive(self, message: Message) -> None:
        self.received.append((self.now_s, message))
        handler = self._handlers.get(message.get_msgId())
        if handler is not None:
            handler(message, self.now_s)

    def _carry(self, arrive: Callable[[], None]) -> None:
        if self._noise.random() < self._loss:
            return
        for _ in range(2 if self._noise.random() < self._doubled else 1):
            late_s = self._noise.uniform(0.0, 0.3) if self._noise.random() < self._late else 0.0
            self._count += 1
            self._under_way.append((self.now_s + late_s, self._count, arrive))


class _Down:
    def __init__(self, send: Callable[[Message, float], None]) -> None:
        self.send = send


def error_of(future: Future[Any]) -> UalError:
    assert future.done()
    error = future.exception()
    assert isinstance(error, UalError)
    return error
