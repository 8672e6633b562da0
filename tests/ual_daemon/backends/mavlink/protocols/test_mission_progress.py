"""Progress of the autopilot's mission, message by message, and the choice of its current item."""

from __future__ import annotations

from concurrent.futures import Future
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from ual.errors import LinkLostError, TaskAbortedError, UalError, UalTimeoutError, WrongStateError
from ual_daemon.backends.mavlink.dialects.ardupilot import ArduCopter
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.protocols.mission_progress import (
    RETRY_S,
    TRIES_COUNT,
    MissionNews,
    MissionProgressProtocol,
)
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.backends.offers.parameters import UndecidedError

ACTIVE = mavlink.MISSION_STATE_ACTIVE
CURRENT, REACHED = mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, mavlink.MAVLINK_MSG_ID_MISSION_ITEM_REACHED
TEXT = mavlink.MAVLINK_MSG_ID_STATUSTEXT


class Bench:
    """The progress with a PX4, and what was sent to it."""

    def __init__(self) -> None:
        self.sent: list[Any] = []
        self.now_s = 100.0
        self.is_up = True
        self.refusal: UalError | None = None
        self.progress = MissionProgressProtocol(self.sent.append, lambda _: self.is_up)
        self.progress.attach(MessageSource(7, 1), Px4())

    @property
    def changes(self) -> tuple[int, int]:
        """Signs of a change of the mission."""
        assert self.progress.heard is not None
        return self.progress.heard.changes

    def current(self, seq: int, state: int = ACTIVE, mission_id: int = 5, total: int = 9) -> None:
        """A MISSION_CURRENT comes."""
        message: Any = mavlink.MAVLink_mission_current_message(seq, total, state, 0)
        message.mission_id = mission_id  # a newer field
        self._take(CURRENT, message)

    def reached(self, seq: int) -> None:
        """A MISSION_ITEM_REACHED comes."""
        self._take(REACHED, mavlink.MAVLink_mission_item_reached_message(seq))

    def _take(self, message_id: int, message: Message) -> None:
        self.progress.handlers[message_id](message, self.now_s)

    def choose(self, seq: int, *shown_by: int) -> Future[None]:
        future: Future[None] = Future()
        self.progress.set_current(seq, frozenset(shown_by or (seq,)), lambda: self.refusal, future)
        self.progress.tick(self.now_s)
        return future

    def pass_tries(self, count: int) -> None:
        for _ in range(count):
            self.now_s += RETRY_S + 0.01
            self.progress.tick(self.now_s)


def test_a_text_and_the_number_of_items_tell_a_change_of_the_mission() -> None:
    bench = Bench()
    bench.progress.attach(MessageSource(7, 1), ArduCopter())
    bench.current(3, mission_id=0)
    told = [bench.changes]
    for text in (b"Mission: 3 WP", b"Auto mission changed, restarted command"):
        bench._take(TEXT, mavlink.MAVLink_statustext_message(6, text))
        told.append(bench.changes)
    bench.current(3, mission_id=0)
    told.append(bench.changes)
    bench.current(3, mission_id=0, total=2)
    told.append(bench.changes)
    assert told == [(9, 0), (9, 0), (9, 1), (9, 1), (2, 1)]


def test_the_newest_word_on_the_mission_is_kept() -> None:
    bench = Bench()
    assert bench.progress.heard is None
    bench.reached(2)  # nothing is known of the mission yet
    assert bench.progress.heard is None
    bench.current(3)
    bench.now_s += 1.0
    bench.reached(3)
    assert bench.progress.heard == MissionNews(ACTIVE, 3, 100.0, 5, 3, 101.0, 9)
    bench.current(4)
    assert bench.progress.heard == MissionNews(ACTIVE, 4, 101.0, 5, 3, 101.0, 9)
    bench.current(1, mission_id=6)  # another mission
    assert bench.progress.heard == MissionNews(ACTIVE, 1, 101.0, 6, total=9)
    bench.progress.drop("the autopilot has booted")
    assert bench.progress.heard is None


def test_an_item_is_chosen_once_the_autopilot_shows_it() -> None:
    bench = Bench()
    bench.current(4)
    future = bench.choose(4)
    assert not future.done()  # what was heard before the request says nothing of it
    bench.current(2)
    assert not future.done()
    bench.current(4)
    assert future.done()
    bench.pass_tries(3)
    assert [(each.target_system, each.target_component, each.seq) for each in bench.sent] == [(7, 1, 4)]


def test_an_item_that_does_not_fly_is_shown_by_the_one_after_it() -> None:
    bench = Bench()
    future = bench.choose(2, 2, 3)
    bench.current(3)
    assert future.done()


def test_a_lost_request_is_sent_again_and_not_for_ever() -> None:
    bench = Bench()
    future = bench.choose(4)
    bench.pass_tries(TRIES_COUNT + 5)
    assert len(bench.sent) == TRIES_COUNT
    assert isinstance(future.exception(timeout=0), UalTimeoutError)


def test_without_a_link_it_says_so() -> None:
    bench = Bench()
    future = bench.choose(4)
    bench.is_up = False
    bench.pass_tries(TRIES_COUNT)
    assert isinstance(future.exception(timeout=0), LinkLostError)


def test_nothing_is_sent_while_it_is_not_known_who_has_taken_the_uav() -> None:
    bench = Bench()
    future = bench.choose(4)
    bench.refusal = UndecidedError("the mode has changed")
    bench.pass_tries(TRIES_COUNT + 5)
    assert len(bench.sent) == 1
    assert not future.done()
    bench.refusal = None
    bench.pass_tries(1)
    assert len(bench.sent) == 2


def test_what_may_not_be_chosen_any_more_is_not_sent_again() -> None:
    bench = Bench()
    future = bench.choose(4)
    bench.refusal = WrongStateError("the pilot flies")
    bench.pass_tries(2)
    assert future.exception(timeout=0) is bench.refusal
    assert len(bench.sent) == 1


def test_another_choice_or_a_boot_ends_the_one_before() -> None:
    bench = Bench()
    first, second = bench.choose(4), bench.choose(5)
    with pytest.raises(TaskAbortedError, match="another item was asked for"):
        first.result(timeout=0)
    bench.progress.drop("the autopilot has booted")
    with pytest.raises(LinkLostError, match="the autopilot has booted"):
        second.result(timeout=0)


def test_a_choice_that_nobody_waits_for_is_not_sent_again() -> None:
    bench = Bench()
    bench.choose(4).cancel()
    bench.pass_tries(3)
    assert len(bench.sent) == 1


STEPS = st.lists(
    st.tuples(st.just("current"), st.integers(0, 65535), st.integers(0, 255), st.integers(0, 2**32 - 1))
    | st.tuples(st.just("reached"), st.integers(0, 65535))
    | st.tuples(st.just("pass_tries"), st.integers(1, 3)),
    max_size=30,
)


@given(steps=STEPS, seq=st.integers(0, 65535))
def test_whatever_comes_a_choice_ends(steps: list[tuple[Any, ...]], seq: int) -> None:
    bench = Bench()
    future = bench.choose(seq)
    for name, *values in steps:
        getattr(bench, name)(*values)
    bench.pass_tries(TRIES_COUNT)
    assert future.done()
    assert len(bench.sent) <= TRIES_COUNT
