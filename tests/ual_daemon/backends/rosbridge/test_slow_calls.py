"""Services that may take long, on a connection of their own: each call ends, and none holds up the next for good."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from concurrent.futures import Future

import pytest
from typing_extensions import override

from tests.simulators.memory_transport import MemoryTransport
from tests.simulators.rosbridge import Bridge, Message
from tests.ual_daemon.backends.rosbridge.test_link import Talker
from ual_daemon.backends.rosbridge import operations
from ual_daemon.backends.rosbridge.calls import ServiceError, ServiceTimeoutError
from ual_daemon.backends.rosbridge.slow_calls import SlowCalls
from ual_daemon.backends.rosbridge.websocket import BridgeTransport

ADD, DEAD, LIMIT_S = "/uav/add", "/uav/refuse", 5.0


class Adder(Talker):
    """Notes what it has added."""

    def __init__(self) -> None:
        super().__init__()
        self.added: list[float] = []

    @property
    @override
    def services(self) -> Mapping[str, Callable[[Message], Message]]:
        return {ADD: self._add}

    def _add(self, arguments: Message) -> Message:
        self.added.append(arguments["a"])
        return {"sum": arguments["a"] + arguments["b"]}


class Bench:
    """Slow calls to a bridge. That of ROS 2 executes the operations of a client one after another."""

    def __init__(self, ros: int = 2) -> None:
        self.now_s = 0.0
        self.adder = Adder()
        self.bridge = Bridge(ros, [self.adder])
        self.connections_count = 0
        self.is_refused = False
        self.calls = SlowCalls(self._connect, lambda: self.now_s)

    def _connect(self) -> BridgeTransport:
        if self.is_refused:
            raise ConnectionRefusedError("nobody listens there")
        self.connections_count += 1
        return MemoryTransport(self.bridge, lambda: None)

    def add(self, a: float) -> Future[Message]:
        return self.calls.call(ADD, {"a": a, "b": 1}, LIMIT_S)

    def pass_s(self, duration_s: float) -> None:
        end_s = self.now_s + duration_s
        while self.now_s < end_s:
            self.now_s += 0.1
            self.calls.serve()
            self.bridge.step(self.now_s)
        self.calls.serve()


def test_it_connects_with_the_first_call_and_once() -> None:
    bench = Bench()
    bench.pass_s(1.0)
    assert bench.connections_count == 0
    answers = [bench.add(number) for number in range(3)]
    bench.pass_s(0.3)
    assert [each.result(0) for each in answers] == [{"sum": 1}, {"sum": 2}, {"sum": 3}]
    assert bench.connections_count == 1


@pytest.mark.parametrize("how", ["late", "withdrawn"])
def test_after_a_call_that_was_not_answered_the_next_has_another_connection(how: str) -> None:
    bench = Bench()
    bench.bridge.faults.dead_services.add(ADD)
    dead = bench.add(1)
    bench.pass_s(0.3)
    if how == "withdrawn":
        dead.cancel()
    else:
        bench.pass_s(LIMIT_S)
        with pytest.raises(ServiceTimeoutError, match=ADD):
            dead.result(0)
    bench.bridge.faults.dead_services.clear()
    bench.pass_s(0.3)
    answer = bench.add(1)
    bench.pass_s(0.3)
    assert answer.result(0) == {"sum": 2}
    assert bench.connections_count == 2


@pytest.mark.parametrize("how", ["late", "withdrawn"])
def test_what_is_in_progress_goes_on_when_an_earlier_call_is_abandoned(how: str) -> None:
    """A mission that is uploaded, for example. With ROS 1 calls do not wait for each other."""
    bench = Bench(ros=1)
    bench.bridge.faults.dead_services.add(DEAD)
    dead = bench.calls.call(DEAD, {}, LIMIT_S)
    bench.pass_s(LIMIT_S - 1.0)
    bench.bridge.faults.slow_services[ADD] = 2.0
    upload = bench.add(1)
    bench.pass_s(0.3)
    if how == "withdrawn":
        dead.cancel()
    bench.pass_s(1.0)
    assert dead.done()
    assert not upload.done()
    bench.bridge.faults.slow_services.clear()
    after = bench.add(2)
    bench.pass_s(1.0)
    assert upload.result(0) == {"sum": 2}
    assert after.result(0) == {"sum": 3}
    assert bench.connections_count == 2
    assert len(bench.calls._connections) == 1


def test_what_cannot_connect_or_is_lost_ends() -> None:
    bench = Bench()
    bench.is_refused = True
    refused = bench.add(1)
    bench.pass_s(0.1)
    bench.is_refused = False
    bench.bridge.faults.dead_services.add(ADD)
    lost = bench.add(1)
    bench.pass_s(0.1)
    bench.calls.end("the connection to the bridge is lost")
    for ended, why in ((refused, "nobody listens there"), (lost, "is lost")):
        with pytest.raises(ServiceError, match=why):
            ended.result(0)


@pytest.mark.parametrize("how", ["late", "withdrawn", "failed"])
def test_a_call_whose_caller_was_informed_otherwise_does_not_leave(how: str) -> None:
    """It may change something: a picture would be taken, or a parameter written, long after its error."""
    bench = Bench()
    bench.add(0)
    bench.pass_s(0.3)
    waiting = bench.add(1)  # while the link is silent, for example: nothing is served
    if how == "late":
        bench.now_s += LIMIT_S + 1.0
    elif how == "withdrawn":
        waiting.cancel()
    else:
        bench.calls._calls.fail_all("an earlier call was not answered")  # another thread has called just before
    bench.pass_s(0.3)
    assert waiting.done()
    assert bench.adder.added == [0]
    answer = bench.add(2)
    bench.pass_s(0.3)
    assert answer.result(0) == {"sum": 3}


def test_a_number_that_is_none_is_written_as_rosbridge_reads_it() -> None:
    """It reads NaN, as Python's JSON has it, and refuses null where a number is expected."""
    assert b'"param4": NaN' in operations.call_service("/push", {"param4": math.nan}, "1", 3.0)


def test_a_call_tells_rosbridge_for_how_long_its_answer_is_awaited() -> None:
    """rosbridge of ROS 2 Jazzy gives up after 5 s else, and a long download would end so."""
    assert json.loads(operations.call_service("/pull", {}, "1", 60.0))["timeout"] == 60.0
