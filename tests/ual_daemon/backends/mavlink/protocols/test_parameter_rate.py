"""Time that 1,000 parameters take at the rate of a serial line, and over a line that loses a fifth; time is stepped."""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.codec import received
from ual.parameters import Parameter
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.protocols.parameter_transfers import ParameterTransfers
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message

COUNT = 1000
BYTES_S = 921_600 / 10
OTHERS = 0.3
"""The part of the line that the autopilot's streams take up."""
STEP_S = 0.005
VALUE_BYTES, LATENCY_S = 37, 0.02


class LinkStub:
    """An autopilot at the other end of a serial line. It answers at once, and the line carries so much."""

    def __init__(self, loss: float) -> None:
        self.now_s = 0.0
        self.carried_bytes = 0.0
        self._noise, self._loss = random.Random(3), loss
        self._queue: deque[int] = deque()
        self._under_way: deque[tuple[float, Callable[[], None]]] = deque()
        self.transfers = ParameterTransfers(self._ask, lambda _: True)
        self.transfers.attach(MessageSource(1, 1), Px4())

    def listed_s(self) -> float:
        """Lists all; returns how long that took."""
        future: Future[list[Parameter]] = Future()
        self.transfers.read_all(future)
        room = 0.0
        while not future.done():
            self.now_s += STEP_S
            room = min(room + BYTES_S * (1.0 - OTHERS) * STEP_S, 2000.0)
            while self._queue and room >= VALUE_BYTES:
                room -= VALUE_BYTES
                self._tell(self._queue.popleft())
            while self._under_way and self._under_way[0][0] <= self.now_s:
                self._under_way.popleft()[1]()
            self.transfers.tick(self.now_s)
        assert [each.name for each in future.result(0)] == [f"P{index:04}" for index in range(COUNT)]
        return self.now_s

    def _ask(self, message: Message) -> None:
        sent: Any = received(message)
        if sent.get_type() == "PARAM_REQUEST_LIST":
            self._carry(lambda: self._queue.extend(range(COUNT)))
        else:
            self._carry(lambda: self._queue.append(sent.param_index))

    def _tell(self, index: int) -> None:
        value = received(mavlink.MAVLink_param_value_message(f"P{index:04}".encode(), float(index), 9, COUNT, index))
        self.carried_bytes += VALUE_BYTES
        self._carry(lambda: self.transfers.on_value(value, self.now_s))

    def _carry(self, arrive: Callable[[], None]) -> None:
        if self._noise.random() >= self._loss:
            self._under_way.append((self.now_s + LATENCY_S, arrive))


@pytest.mark.parametrize(("loss", "limit_s"), [(0.0, 1.0), (0.2, 15.0)])
def test_1000_parameters_at_921600_baud(loss: float, limit_s: float) -> None:
    line = LinkStub(loss)
    took_s = line.listed_s()
    assert took_s < limit_s
    assert line.carried_bytes / took_s < BYTES_S
