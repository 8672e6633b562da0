"""Corrections, piece by piece: how they are cut, put together by the autopilots, paced, and dropped."""

from __future__ import annotations

import sys
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from tests.rtcm import message, messages
from tests.simulators.codec import received
from tests.simulators.satellite_receiver import SatelliteReceiver
from ual_daemon.backends.firmwares.baseline import REPORT_AGE_LIMIT_S
from ual_daemon.backends.mavlink.dialects.ardupilot import ArduCopter
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.protocols.corrections_injection import (
    LONGEST_BYTES,
    MESSAGE_PACE_S,
    NO_CORRECTIONS,
    RECEIVER_REQUEST_S,
    CorrectionsInjection,
    pieces,
)
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.backends.offers.corrections import MOST_WAITING_BYTES
from ual_daemon.services.rtcm import RtcmFramer


class Bench:
    """The corrections of an autopilot, and what its receiver gets."""

    def __init__(self, dialect: Dialect | None = None) -> None:
        self.now_s = 100.0
        self.is_up = self.has_room = self.leaves = True
        self.receiver = SatelliteReceiver()
        self.others: list[Any] = []
        self.injection = CorrectionsInjection(self._send, lambda _: self.is_up, lambda: self.has_room)
        self.injection.attach(MessageSource(7, 1), dialect or Px4())

    def tick(self, count: int = 1, every_s: float = MESSAGE_PACE_S) -> None:
        for _ in range(count):
            self.injection.tick(self.now_s)
            self.now_s += every_s

    def _send(self, message: Message) -> bool:
        if not self.leaves:
            return False
        sent = received(message)
        if sent.get_type() == "GPS_RTCM_DATA":
            self.receiver.on_rtcm_data(sent)
        else:
            self.others.append(sent)
        return True


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.mark.parametrize("length", [8, 179, 180, 181, 359, 360, 361, 539, 540, 541, 719, 720])
def test_each_length_is_put_together_by_both_autopilots(bench: Bench, length: int) -> None:
    sent = messages([length, length, 50])
    for each in sent:
        bench.injection.give(each)
    bench.tick(20)
    assert bench.receiver.messages == sent
    assert b"".join(bench.receiver.pieces) == b"".join(sent)
    assert bench.receiver.discarded_count == 0
    assert bench.injection.counts.messages_count == 3
    assert bench.injection.counts.bytes_count == 2 * length + 50


def test_a_message_that_fills_its_pieces_ends_with_an_empty_one() -> None:
    assert [len(each) for _, each in pieces(message(180), 0)] == [180]
    assert [len(each) for _, each in pieces(message(360), 0)] == [180, 180, 0]
    assert [len(each) for _, each in pieces(message(540), 0)] == [180, 180, 180, 0]
    assert [len(each) for _, each in pieces(message(720), 0)] == [
        180,
        180,
        180,
        180,
    ]  # four are complete, and no fifth is


def test_the_flags_have_the_fragment_and_the_sequence() -> None:
    assert [flags for flags, _ in pieces(message(400), 33)] == [
        1 | 0 << 1 | 1 << 3,
        1 | 1 << 1 | 1 << 3,
        1 | 2 << 1 | 1 << 3,
    ]
    assert [flags for flags, _ in pieces(message(100), 31)] == [31 << 3]


@given(st.lists(st.integers(8, LONGEST_BYTES), max_size=60))
def test_any_messages_arrive_whole_and_in_order(lengths: list[int]) -> None:
    bench = Bench()
    sent = messages(lengths)
    for each in sent:
        bench.injection.give(each)
        bench.tick(4)
    bench.tick(4)
    assert bench.receiver.messages == sent
    assert b"".join(bench.receiver.pieces) == b"".join(sent)


def test_a_burst_is_spread_so_that_px4s_queue_holds_it(bench: Bench) -> None:
    for each in messages([500] * 10):
        bench.injection.give(each)
    counts = []
    for _ in range(8):
        before = len(bench.receiver.pieces)
        bench.tick(5, every_s=0.01)
        counts.append(len(bench.receiver.pieces) - before)
    assert max(counts) <= 6  # in 50 ms, in which PX4's driver takes 8
    assert sum(counts) == 30


def test_nothing_is_sent_while_something_urgent_would_wait_for_it(bench: Bench) -> None:
    bench.injection.give(message(400))
    bench.has_room = False
    bench.tick(10)
    assert bench.receiver.pieces == []
    bench.has_room = True
    bench.tick(2)
    assert bench.receiver.messages == [message(400)]


def test_a_piece_that_could_not_leave_is_sent_again_and_the_oldest_that_wait_are_dropped(bench: Bench) -> None:
    sent = messages([700] * 20)
    bench.injection.give(sent[0])
    bench.tick()
    bench.leaves = False
    for each in sent[1:]:
        bench.injection.give(each)
        bench.tick()
    bench.leaves = True
    bench.tick(60)
    kept_count = MOST_WAITING_BYTES // 700
    assert bench.receiver.messages == [sent[0], *sent[-kept_count:]]
    assert bench.injection.counts.dropped_count == 20 - 1 - kept_count
    assert bench.receiver.discarded_count == 0


def test_what_waits_is_dropped_where_the_link_is_lost_and_at_a_boot(bench: Bench) -> None:
    for each in messages([700, 100, 100]):
        bench.injection.give(each)
    bench.tick()
    bench.is_up = False
    bench.tick(3)
    assert bench.injection.counts.dropped_count == 3
    bench.is_up = True
    bench.injection.give(message(100, 5))
    bench.injection.drop("the autopilot has booted")
    bench.tick(3)
    bench.injection.give(message(400, 6))
    bench.tick(3)
    assert bench.receiver.messages == [message(400, 6)]
    assert bench.injection.counts.dropped_count == 4


def test_the_age_is_that_of_the_last_whole_message(bench: Bench) -> None:
    assert bench.injection.status(bench.now_s) is NO_CORRECTIONS
    bench.injection.give(message(400))
    bench.tick(2)
    assert bench.injection.status(bench.now_s + 2.0).age_s == pytest.approx(2.0, abs=0.1)
    assert bench.injection.status(bench.now_s + 2.0).baseline_m is None


def test_the_baseline_is_requested_while_corrections_are_sent_and_believed_while_it_is_new() -> None:
    bench = Bench(ArduCopter())
    bench.tick(100)
    assert bench.others == []
    for seed in range(4):
        bench.injection.give(message(100, seed))
        bench.tick(1, every_s=0.6 * RECEIVER_REQUEST_S)
    asked = [(each.command, each.param1) for each in bench.others]
    assert asked == [(511, 127), (511, 128)] * 2
    rtk = mavlink.MAVLink_gps_rtk_message(0, 0, 0, 0, 0, 1, 12, 1, 3_000, 4_000, -12_000, 0, 0)
    bench.injection.on_baseline(rtk, bench.now_s)
    assert bench.injection.status(bench.now_s).baseline_m == pytest.approx(13.0)
    assert bench.injection.status(bench.now_s + REPORT_AGE_LIMIT_S + 0.1).baseline_m is None


def test_a_px4_is_not_requested_what_it_does_not_have(bench: Bench) -> None:
    bench.injection.give(message(100))
    bench.tick(3)
    assert bench.others == []


LINE_BYTES_PER_S = 5760.0
"""A serial line of 57,600 baud, ..."""
SETPOINT_BYTES, SETPOINT_S = 65, 0.05
PIECE_BYTES = 12 + 182
"""... and a GPS_RTCM_DATA on it."""
HOURS = 6


class SlowSerialLink:
    """A serial line: what is written leaves byte by byte."""

    def __init__(self) -> None:
        self.unsent = 0.0
        self.pieces_count = 0
        self.longest_s = 0.0

    def pass_time(self, duration_s: float) -> None:
        self.unsent = max(0.0, self.unsent - duration_s * LINE_BYTES_PER_S)

    def send(self, _: Message) -> bool:
        self.unsent += PIECE_BYTES
        self.pieces_count += 1
        return True

    def setpoint(self) -> None:
        self.longest_s = max(self.longest_s, self.unsent / LINE_BYTES_PER_S)
        self.unsent += SETPOINT_BYTES


def test_six_hours_keep_memory_flat_and_no_setpoint_waits_for_more_than_the_piece_that_leaves() -> None:
    """A base of 1 kB/s, a slow line. A setpoint that comes while a piece leaves waits for that, and for no second."""
    line, framer = SlowSerialLink(), RtcmFramer()
    injection = CorrectionsInjection(line.send, lambda _: True, lambda: line.unsent == 0.0)
    injection.attach(MessageSource(1, 1), Px4())
    of_a_second = b"".join(messages([250, 150, 200, 60, 340]))
    blocks, now_s = [], 0.0
    for _ in range(HOURS):
        for _ in range(3600):
            for each in framer.feed(of_a_second):
                injection.give(each)
            for number in range(round(1.0 / SETPOINT_S)):
                now_s += SETPOINT_S
                after_s = number % 4 * SETPOINT_S / 4.0  # the tick comes so long after a setpoint
                line.setpoint()
                line.pass_time(after_s)
                injection.tick(now_s)
                line.pass_time(SETPOINT_S - after_s)
        blocks.append(sys.getallocatedblocks())
    counts = injection.counts
    assert (counts.bytes_count, counts.dropped_count) == (HOURS * 3600 * 1000, 0)
    assert line.pieces_count == HOURS * 3600 * 8
    assert line.longest_s <= PIECE_BYTES / LINE_BYTES_PER_S
    assert max(blocks[1:]) - blocks[0] < 500
