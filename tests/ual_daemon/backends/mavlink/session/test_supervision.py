import logging

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from tests.ual_daemon.backends.mavlink.fakes import BOOT_MS, Harness, attitude, heartbeat, packer
from ual_daemon.backends.engine.link_watch import LinkWatch, LinkWatchState
from ual_daemon.backends.mavlink.session.heartbeat_watchdog import HEARTBEAT_LATE_S
from ual_daemon.backends.mavlink.session.supervision import LinkCounts
from ual_daemon.backends.mavlink.settings import MavlinkSettings


def beat(watch: LinkCounts, begin_s: float, end_s: float, rate_hz: float = 10.0, first: int = 0) -> int:
    """Frames come; the next number."""
    count = round((end_s - begin_s) * rate_hz)
    for index in range(count):
        watch.on_frame((first + index) % 256, begin_s + index / rate_hz)
    return first + count


def test_rate_and_loss_are_those_of_the_last_seconds() -> None:
    watch = LinkCounts(LinkWatch("udp", 1.0))
    for index in range(2000):
        if index % 4 or index < 1000:
            watch.on_frame(index % 256, index / 100)
    late = watch.statistics(20.0)
    assert late.rate_hz == pytest.approx(75.0, rel=0.05)
    assert late.loss == pytest.approx(0.25, abs=0.02)
    assert watch.statistics(60.0).rate_hz == 0.0


def test_a_silence_is_not_counted_as_lost_messages() -> None:
    watch = LinkCounts(LinkWatch("udp", 1.0))
    following = beat(watch, 0.0, 2.0, rate_hz=100.0)
    beat(watch, 5.0, 6.0, rate_hz=100.0, first=following + 300)
    assert watch.statistics(6.0).loss == 0.0


@given(
    st.lists(
        st.tuples(
            st.sampled_from((1, 1, 1, 1, 1, 1, 0, 2, 3, 9, 130, 200, 254, 255)),
            st.sampled_from((0.0, 0.002, 0.01, 0.02, 0.09, 0.11, 0.6, 1.0, 3.0, 12.0)),
        ),
        max_size=200,
    )
)
def test_what_is_counted_in_few_steps_is_what_the_long_path_counts(frames: list[tuple[int, float]]) -> None:
    both = tuple(LinkCounts(LinkWatch("udp", 1.0)) for _ in range(2))
    sequence, now_s = 250, 0.0
    for step, passed_s in frames:
        sequence, now_s = (sequence + step) % 256, now_s + passed_s
        for each in both:
            each.on_frame(sequence, now_s)
        both[1]._gaps._newest, both[1]._gaps.next = sequence_of(both[1]), None
        assert both[0].statistics(now_s) == both[1].statistics(now_s)
        assert (both[0].watch.heard_s, both[0].watch.state) == (both[1].watch.heard_s, both[1].watch.state)


def sequence_of(supervision: LinkCounts) -> int | None:
    gaps = supervision._gaps
    return gaps._newest if gaps.next is None else gaps.next - 1


# --- In the session ---------------------------------------------------------------------------------------------------


def test_only_the_chosen_autopilot_counts() -> None:
    harness = Harness()
    harness.receive(heartbeat())
    harness.now_s = 0.9
    harness.receive(data=packer(2)(heartbeat()) + packer(1, 154)(attitude()))
    harness.run(0.2)
    assert harness.supervision.watch.state is LinkWatchState.LOST


def test_timesync_is_queried_and_answered() -> None:
    harness = Harness()
    harness.receive(heartbeat())
    harness.run(0.05)
    (request,) = harness.link.take("TIMESYNC")
    harness.now_s += 0.03
    harness.receive(mavlink.MAVLink_timesync_message(123, request.ts1))
    assert harness.supervision.statistics(harness.now_s).round_trip_s == pytest.approx(0.03)
    assert harness.link.take("TIMESYNC") == []
    harness.receive(mavlink.MAVLink_timesync_message(0, 77))
    (answer,) = harness.link.take("TIMESYNC")
    assert answer.ts1 == 77
    assert answer.tc1 > 0
    harness.run(3.1)
    assert len(harness.link.take("TIMESYNC")) == 3


def test_a_reboot_is_observed_in_any_message_that_tells_the_time_since_boot() -> None:
    harness = Harness()
    harness.receive(heartbeat(), attitude(boot_ms=BOOT_MS))
    harness.now_s += 1.0
    young = attitude(boot_ms=BOOT_MS // 10)
    harness.receive(young, young, young)
    assert harness.supervision.watch.reboots_count == 1


def test_another_autopilot_is_reported_once_with_the_ids_and_how_to_choose(caplog: pytest.LogCaptureFixture) -> None:
    harness = Harness()
    ground_station = heartbeat(autopilot=mavlink.MAV_AUTOPILOT_INVALID, kind=mavlink.MAV_TYPE_GCS)
    with caplog.at_level(logging.WARNING):
        for _ in range(3):
            harness.receive(data=packer(7)(heartbeat()) + packer(3)(heartbeat()) + packer(255)(ground_station))
    (told,) = [record.message for record in caplog.records if "more than one" in record.message]
    assert told == (
        "more than one autopilot is heard: system 3 and system 7; this one flies system 7, the first heard; "
        "choose with mavlink.system_id"
    )


def test_who_has_chosen_is_not_informed_of_others(caplog: pytest.LogCaptureFixture) -> None:
    harness = Harness(MavlinkSettings(system_id=7))
    with caplog.at_level(logging.WARNING):
        harness.receive(data=packer(7)(heartbeat()) + packer(3)(heartbeat()))
    assert caplog.records == []


def test_a_heartbeat_that_is_late_is_requested_while_others_come() -> None:
    harness = Harness()
    harness.receive(heartbeat())
    asked: list[float] = []
    while harness.now_s < 2.0:
        harness.receive(attitude())
        harness.run(0.1)
        asked += [harness.now_s for each in harness.commands(mavlink.MAV_CMD_REQUEST_MESSAGE) if each.param1 == 0.0]
    assert asked[0] == pytest.approx(HEARTBEAT_LATE_S, abs=0.11)
    assert len(asked) > 3
    harness.receive(heartbeat())
    harness.run(1.0)
    assert [each for each in harness.commands(mavlink.MAV_CMD_REQUEST_MESSAGE) if each.param1 == 0.0] == []
