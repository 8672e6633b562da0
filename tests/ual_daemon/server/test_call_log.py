"""Calls are observed whatever becomes of them."""

from __future__ import annotations

from collections.abc import Callable

import grpc
from typing_extensions import override

from ual_daemon.server.call_log import CallObserver, CallRecord, observed
from ual_daemon.server.transport.base import Metadata, ServedCall


class ScriptedCall(ServedCall):
    """A call whose caller is a test."""

    def __init__(self) -> None:
        self.method = "/ual.v1.UalService/TakeOff"
        self.metadata = (("user-agent", "a test"),)
        self.is_finished = False
        self.is_cancelled = False
        self.give_up: Callable[[], object] = lambda: None
        self.say: Callable[[bytes | None], object] = lambda _: None

    @override
    def peer(self) -> str:
        return "ipv4:127.0.0.1:5"

    @override
    def certificate_name(self) -> str | None:
        return None

    @override
    def watch(self, on_cancel: Callable[[], object]) -> None:
        self.give_up = on_cancel

    @override
    def receive(self, then: Callable[[bytes | None], object]) -> None:
        self.say = then

    @override
    def begin(self) -> None:
        return None

    @override
    def send(self, message: bytes, then: Callable[[bool], object]) -> None:
        then(True)

    @override
    def finish(
        self,
        message: bytes | None = None,
        code: grpc.StatusCode = grpc.StatusCode.OK,
        details: str = "",
        metadata: Metadata = (),
    ) -> None:
        self.is_finished = True


class Notes(CallObserver):
    """Keeps what is observed."""

    def __init__(self) -> None:
        self.records: list[CallRecord] = []
        self.before: list[object] = []

    @override
    def on_request(self, method: str) -> object:
        return f"before {method}"

    @override
    def on_call(self, record: CallRecord, before: object) -> None:
        self.records.append(record)
        self.before.append(before)


def begun() -> tuple[ScriptedCall, ServedCall, list[CallRecord]]:
    """A call, the same as the server sees it, and what is observed of it."""
    taken: list[ServedCall] = []
    call, notes = ScriptedCall(), Notes()
    observed(taken.append, [notes])(call)
    return call, taken[0], notes.records


def test_a_call_that_is_answered_at_once_is_observed_once() -> None:
    call, seen, records = begun()
    seen.receive(lambda _: seen.finish(b"answer"))
    call.say(b"request")
    [record] = records
    assert (record.has_ended, record.code, record.request, record.response) == (True, "OK", b"request", b"answer")
    assert (record.caller, record.agent) == ("ipv4:127.0.0.1:5", "a test")
    assert record.at_ns >= record.began_ns
    assert call.is_finished
    assert seen.is_finished


def test_a_call_that_waits_is_observed_when_it_has_begun_and_when_it_has_ended() -> None:
    call, seen, records = begun()
    seen.receive(lambda _: seen.watch(lambda: None))
    call.say(b"request")
    assert [record.has_ended for record in records] == [False]
    seen.finish(None, grpc.StatusCode.ABORTED, "the pilot took over")
    assert [(record.code, record.details) for record in records] == [("", ""), ("ABORTED", "the pilot took over")]
    assert {record.number for record in records} == {records[0].number}


def test_a_caller_that_vanishes_is_observed_once_whatever_the_server_says_afterwards() -> None:
    call, seen, records = begun()
    gone: list[None] = []
    seen.watch(lambda: gone.append(None))
    call.give_up()
    seen.finish(None, grpc.StatusCode.ABORTED, "too late")
    assert [record.code for record in records] == ["CANCELLED"]
    assert seen.is_cancelled
    assert gone == [None]


def test_the_messages_of_streams_are_counted() -> None:
    call, seen, records = begun()
    for message in (b"first", b"second", None):
        seen.receive(lambda _: None)
        call.say(message)
    for _ in range(3):
        seen.send(b"sample", lambda _: None)
    seen.finish(b"last")
    ended = records[-1]
    assert (ended.request, ended.requests_count, ended.response, ended.responses_count) == (b"first", 2, b"last", 4)
    assert [record.has_ended for record in records] == [False, True]


def test_what_was_before_the_request_is_handed_back_with_each_record() -> None:
    taken: list[ServedCall] = []
    call, notes = ScriptedCall(), Notes()
    observed(taken.append, [notes])(call)
    taken[0].receive(lambda _: taken[0].watch(lambda: None))
    call.say(b"request")
    taken[0].finish(b"answer")
    assert notes.before == [f"before {call.method}"] * 2


class Defective(CallObserver):
    """Can observe nothing."""

    @override
    def on_request(self, method: str) -> object:
        raise OverflowError(method)

    @override
    def on_call(self, record: CallRecord, before: object) -> None:
        raise ValueError(record.method)


def test_an_observer_that_fails_keeps_no_call_and_no_other_observer_from_its_end() -> None:
    taken: list[ServedCall] = []
    call, notes = ScriptedCall(), Notes()
    observed(taken.append, [Defective(), notes])(call)
    [seen] = taken
    seen.receive(lambda _: seen.finish(b"answer"))
    call.say(b"request")
    assert call.is_finished
    assert [record.response for record in notes.records] == [b"answer"]
    assert notes.before == [f"before {call.method}"]
