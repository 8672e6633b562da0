"""A bridge that stalls, in a time that the link's thread steps: what is sent meanwhile, and what is not."""

from __future__ import annotations

import json
import socket
import struct
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from typing_extensions import override

from tests.conftest import LIMIT_S
from tests.simulators.memory_transport import MemoryTransport
from tests.simulators.rosbridge import Bridge
from tests.simulators.rosbridge_server import RosbridgeServer
from tests.ual_daemon.backends.rosbridge.test_link import Talker
from ual_daemon.backends.rosbridge import BridgeUrl, RosbridgeLink, RosbridgeState, operations, parse_url
from ual_daemon.backends.rosbridge.calls import ServiceError
from ual_daemon.backends.rosbridge.websocket import WebSocket, dial

STALLS_S, STEP_S = 2.0, 0.02


class Stall:
    """A bridge that stalls after 2 s, for `duration_s`. `on_step` is called on the link's thread until 6 s."""

    def __init__(self, duration_s: float, on_step: Callable[[Stall], None]) -> None:
        self.duration_s = duration_s
        self.bridge = Bridge(1, [Talker()])
        self.sent: list[tuple[float, dict[str, Any]]] = []
        self.states: set[RosbridgeState] = set()
        self.time_s = 0.0
        self._on_step = on_step
        self._over = threading.Event()
        self.link = RosbridgeLink(parse_url("rosbridge://127.0.0.1:1"), self, self._step, lambda *_: _Stalling(self))
        self.link.advertise("/uav/setpoint", "test_msgs/Setpoint")

    def now_s(self) -> float:
        return self.time_s

    @property
    def is_stalled(self) -> bool:
        return STALLS_S < self.time_s < STALLS_S + self.duration_s

    def advance(self) -> None:
        self.time_s += STEP_S
        self.bridge.step(self.time_s)

    def run(self) -> None:
        self.link.open()
        assert self._over.wait(LIMIT_S)
        self.link.close()

    @contextmanager
    def as_if_up(self) -> Iterator[None]:
        """Makes the state that of another thread that has looked before the link fell silent."""
        state, self.link.state = self.link.state, RosbridgeState.UP
        yield
        self.link.state = state

    def sent_s(self, operation: str, name: str = "") -> list[float]:
        """Returns when operations were sent; of a service, if it is given."""
        return [at for at, each in self.sent if each["op"] == operation and name in each.get("service", "")]

    def _step(self) -> None:
        self.states.add(self.link.state)
        if self.time_s > 6.0:
            self._over.set()
        else:
            self._on_step(self)


class _Stalling(MemoryTransport):
    def __init__(self, it: Stall) -> None:
        super().__init__(it.bridge, it.advance)
        self._it = it

    @override
    def _take(self) -> Sequence[str | bytes]:
        return () if self._it.is_stalled else super()._take()

    @override
    def send(self, text: bytes, *, is_perishable: bool = False) -> bool:
        self._it.sent.append((self._it.time_s, json.loads(text)))
        return super().send(text)


def publish(it: Stall) -> None:
    it.link.publish("/uav/setpoint", {"x": it.time_s})


def test_no_setpoint_is_sent_to_a_bridge_that_has_not_answered_a_ping_for_long() -> None:
    it = Stall(3.0, publish)
    it.run()
    assert RosbridgeState.SILENT in it.states
    during = [at for at in it.sent_s("publish") if it.duration_s + STALLS_S > at > STALLS_S]
    assert max(during) < STALLS_S + 0.3 + 0.1 + 3.0 * STEP_S
    assert max(it.sent_s("publish")) > 5.9


def test_after_a_short_stall_the_newest_setpoint_leaves_and_no_older_one() -> None:
    it = Stall(0.7, publish)
    it.run()
    assert RosbridgeState.SILENT not in it.states
    ages_s = [at - each["msg"]["x"] for at, each in it.sent if each["op"] == "publish"]
    assert max(ages_s) < 2.0 * STEP_S


def test_a_call_whose_time_is_over_is_not_sent_any_more() -> None:
    def call(it: Stall) -> None:
        if it.time_s > STALLS_S + 0.45 and not calls:
            calls.append(it.link.call_service("/uav/add", {"a": 1, "b": 2}, timeout_s=0.1))

    calls: list[Any] = []
    it = Stall(0.7, call)
    it.run()
    assert isinstance(calls[0].exception(LIMIT_S), ServiceError)
    assert it.sent_s("call_service", "/uav/add") == []


def test_a_call_that_waits_is_sent_when_the_bridge_answers_again_within_its_time() -> None:
    def call(it: Stall) -> None:
        if it.time_s > STALLS_S + 0.45 and not calls:
            calls.append(it.link.call_service("/uav/add", {"a": 1, "b": 2}, timeout_s=2.0))

    calls: list[Any] = []
    it = Stall(0.7, call)
    it.run()
    assert calls[0].result(LIMIT_S) == {"sum": 3}
    assert min(it.sent_s("call_service", "/uav/add")) >= STALLS_S + 0.7


def test_a_bridge_that_may_have_stalled_holds_up_calls() -> None:
    held_s: list[float] = []
    it = Stall(0.7, lambda it: held_s.append(it.time_s) if it.link.is_up and it.link.holds_up_calls else None)
    it.run()
    assert STALLS_S + 0.3 < min(held_s) < STALLS_S + 0.3 + 0.1 + 3.0 * STEP_S
    assert max(held_s) < STALLS_S + 0.7 + 2.0 * STEP_S


def test_a_call_that_is_withdrawn_by_what_comes_when_the_bridge_goes_on_is_not_sent() -> None:
    """Not even if another call is made after it."""

    def call(it: Stall) -> None:
        if it.time_s > STALLS_S + 0.45 and not calls:
            calls.append(it.link.call_service("/uav/add", {"a": 1, "b": 2}, timeout_s=2.0))
        if it.time_s > STALLS_S + 0.7 and len(calls) == 1:
            calls[0].cancel()
            calls.append(it.link.call_service("/uav/refuse"))

    calls: list[Any] = []
    it = Stall(0.7, call)
    it.run()
    assert calls[0].cancelled()
    assert it.sent_s("call_service", "/uav/add") == []
    assert it.sent_s("call_service", "/uav/refuse") != []


def test_no_call_is_sent_while_the_bridge_is_silent_nor_kept_from_before() -> None:
    def call(it: Stall) -> None:
        if it.time_s > STALLS_S + 0.45 and not calls:
            calls.append(it.link.call_service("/uav/add", {"a": 1, "b": 2}, timeout_s=4.0))
        if it.link.state is RosbridgeState.SILENT and len(calls) == 1:
            calls.append(it.link.call_service("/uav/add", {"a": 1, "b": 2}, timeout_s=4.0))

    calls: list[Any] = []
    it = Stall(2.0, call)
    it.run()
    for each in calls:
        assert "does not answer" in str(each.exception(LIMIT_S))
    assert len(calls) == 2
    assert it.sent_s("call_service", "/uav/add") == []


def test_what_another_thread_was_about_to_send_when_the_bridge_fell_silent_never_leaves() -> None:
    """It had seen that the link was up."""

    def put(it: Stall) -> None:
        connections = it.link._connections
        if it.link.state is RosbridgeState.SILENT and not calls:
            assert connections is not None
            connections.published.put("/uav/setpoint", operations.publish("/uav/setpoint", {"x": 1.0}), may_leave=False)
            with it.as_if_up():
                calls.append(it.link.call_service("/uav/add", {"a": 1, "b": 2}, timeout_s=4.0))

    calls: list[Any] = []
    it = Stall(2.0, put)
    it.run()
    assert it.sent_s("publish") == []
    assert "does not answer" in str(calls[0].exception(LIMIT_S))
    assert it.sent_s("call_service", "/uav/add") == []


def test_a_connection_that_is_abandoned_is_reset() -> None:
    with RosbridgeServer(Bridge(1, [Talker()])) as server:
        transport = dial(BridgeUrl("127.0.0.1", server.port), lambda: None)
        assert isinstance(transport, WebSocket)
        other = transport._socket.dup()
        transport.abort()
        with other:
            assert struct.unpack("ii", other.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, 8)) == (1, 0)
