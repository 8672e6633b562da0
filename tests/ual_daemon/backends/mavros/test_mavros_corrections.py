"""Corrections of satellites through a simulated MAVROS and its plugin: what the receivers of both autopilots get."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.rtcm import message, messages
from tests.simulators.lockstep_mavros import LockstepMavros
from tests.ual_daemon.backends.mavros.test_mavros_faults import make
from tests.waiting import until
from ual.types import State
from ual_daemon import UAL
from ual_daemon.backends.engine.link_watch import LinkWatch
from ual_daemon.backends.firmwares.ardupilot import ArduCopter
from ual_daemon.backends.firmwares.baseline import REPORT_AGE_LIMIT_S
from ual_daemon.backends.mavros import topics
from ual_daemon.backends.mavros.corrections import MavrosCorrections, pieces
from ual_daemon.backends.mavros.telemetry import MavrosTelemetry
from ual_daemon.backends.rosbridge import Message

LENGTHS = [25, 180, 360, 540, 720, 333, 179, 181]


@pytest.fixture(params=["px4", "ardupilot"])
def backend(request: pytest.FixtureRequest) -> LockstepMavros:
    return make(request.param)


@pytest.fixture
def uav(backend: LockstepMavros) -> Iterator[UAL]:
    with UAL(backend) as uav:
        until(lambda: uav.state() is State.LANDED_DISARMED, "a state", seen=uav.telemetry)
        yield uav


def test_they_get_to_the_receiver_whole_and_in_order(uav: UAL, backend: LockstepMavros) -> None:
    sent, receiver = messages(LENGTHS * 2), backend.autopilot.receiver
    status = uav.corrections.stream(iter(sent), "a base")
    until(lambda: b"".join(receiver.pieces) == b"".join(sent), "the bytes", seen=uav.corrections.status)
    assert b"".join(receiver.messages) == b"".join(sent)
    assert receiver.discarded_count == 0
    assert (status.dropped_count, uav.corrections.status().messages_count) == (0, len(sent))
    until(lambda: (gps := uav.telemetry().gps) is not None and gps.corrections_age_s is not None, "their age")


def test_what_fills_two_or_three_fragments_is_cut_elsewhere() -> None:
    assert [len(each) for each in pieces(message(360))] == [100, 260]
    assert [len(each) for each in pieces(message(540))] == [100, 440]
    assert [[len(each) for each in pieces(message(length))] for length in (180, 361, 720)] == [[180], [361], [720]]


class Bench:
    """The corrections of a MAVROS, without one."""

    def __init__(self) -> None:
        self.now_s, self.why_not, self.waits = 100.0, "", False
        self.published: list[Message] = []
        self.corrections = MavrosCorrections(
            self.published.append,
            lambda: self.waits,
            lambda: self.why_not,
            lambda request: request(self.now_s),
            lambda: self.now_s,
        )

    def tick(self) -> None:
        self.now_s += 0.05
        self.corrections.tick(self.now_s)


def test_none_replaces_one_that_waits() -> None:
    bench = Bench()
    for each in messages([100, 360]):
        bench.corrections.inject(each)
    bench.tick()
    bench.waits = True
    bench.tick()
    assert len(bench.published) == 1
    bench.waits = False
    bench.tick()
    bench.tick()
    assert len(bench.published) == 3
    assert bench.corrections.injected().messages_count == 2
    assert bench.corrections.age_s(bench.now_s + 1.0) == 1.0


def test_what_waits_while_the_autopilot_is_not_received_is_dropped_and_counted() -> None:
    bench = Bench()
    for each in messages([360, 100]):
        bench.corrections.inject(each)
    bench.tick()
    bench.why_not = "cannot send corrections: no autopilot is heard"
    bench.tick()
    assert bench.corrections.injected().dropped_count == 2
    bench.why_not = ""
    bench.tick()
    assert len(bench.published) == 1


def test_the_baseline_is_reported_while_it_comes() -> None:
    telemetry = MavrosTelemetry(ArduCopter(), LinkWatch("a bridge", 1.0), lambda: 0.0)
    fix = {
        "status": {"status": 0},
        "position_covariance_type": 0,
        "latitude": 47.0,
        "longitude": 8.0,
        "altitude": 500.0,
    }
    telemetry.update(topics.FIX, fix, 10.0)
    telemetry.update(topics.GPS_RTK, {"baseline_a": 3000, "baseline_b": -4000, "baseline_c": 0}, 10.0)

    def reported_m(now_s: float) -> float | None:
        gps = telemetry.snapshot(now_s).condition.gps
        return None if gps is None else gps.baseline_m

    assert reported_m(10.5) == 5.0
    assert reported_m(10.0 + REPORT_AGE_LIMIT_S + 0.1) is None
