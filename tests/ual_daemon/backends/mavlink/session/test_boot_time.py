"""Conditions for a reboot: several messages agree, none of the old boot comes any more, and not too often."""

from __future__ import annotations

import logging
import random

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.ual_daemon.backends.mavlink.fakes import BOOT_MS, UTC_S, Harness, attitude, heartbeat, position
from ual_daemon.backends.engine.boot_time import MESSAGE_SILENCE_S, PROOFS_COUNT, SHORTEST_BOOT_S, WRAP_S, BootTime
from ual_daemon.backends.mavlink.wire.messages import Message


def run(boot: BootTime, boot_s: float, now_s: float, duration_s: float, rate_hz: float = 50.0) -> int:
    """An autopilot's stream. Returns how many reboots are believed."""
    steps = round(duration_s * rate_hz)
    return sum(boot.update(boot_s + step / rate_hz, now_s + step / rate_hz) for step in range(steps))


def test_a_reboot_is_believed_at_the_third_message_after_the_silence_of_booting() -> None:
    boot = BootTime()
    assert run(boot, 100.0, 0.0, 1.0) == 0
    assert [boot.update(boot_s, 4.0 + boot_s) for boot_s in (2.0, 2.02, 2.04)] == [False, False, True]
    assert boot.boot_s == 2.04


def test_a_reboot_without_a_silence_is_believed_once_the_old_boot_is_not_received_any_more() -> None:
    boot = BootTime()
    run(boot, 100.0, 0.0, 1.0)
    believed_s = next(step / 50.0 for step in range(100) if boot.update(3.0 + step / 50.0, 1.0 + step / 50.0))
    assert MESSAGE_SILENCE_S - 0.04 <= believed_s <= MESSAGE_SILENCE_S + 0.02


@pytest.mark.parametrize("wild_s", [0.001, 50.0, 2000.0, 4e6])
def test_wild_times_between_true_ones_are_no_reboot(wild_s: float) -> None:
    boot, count = BootTime(), 0
    for step in range(2000):
        count += boot.update(100.0 + step / 50.0, step / 50.0)
        for proof in range(2 * PROOFS_COUNT):
            count += boot.update(wild_s + (step + proof / 10.0) / 50.0, (step + proof / 10.0) / 50.0)
    assert count == 0
    assert boot.boot_s == pytest.approx(100.0 + 1999 / 50.0)


def test_random_times_are_no_reboot_even_where_the_autopilot_is_silent() -> None:
    boot, noise = BootTime(), random.Random(1)
    run(boot, 100.0, 0.0, 1.0)
    assert sum(boot.update(noise.uniform(0.0, 4e6), 1.0 + step / 1000.0) for step in range(10_000)) == 0


def test_reboots_are_believed_no_more_often_than_an_autopilot_can_boot() -> None:
    boot = BootTime()
    run(boot, 1000.0, 0.0, 1.0)
    count = sum(run(boot, 500.0 - 2.0 * number, 1.0 + 0.4 * number, 0.4) for number in range(100))
    assert 2 <= count <= 40.0 / SHORTEST_BOOT_S + 1


@pytest.mark.parametrize("silence_s", [0.0, 0.9])
def test_milliseconds_that_begin_anew_after_49_days_are_no_reboot(silence_s: float) -> None:
    """In flight all that was known was discarded, and the task ended. With a silence of 0.3 s before, at once."""
    boot = BootTime()
    assert run(boot, WRAP_S - 1.0, 0.0, 1.0) == 0
    anew_s = 1.0 + silence_s
    for step in range(100):
        assert not boot.update(silence_s + step / 50.0, anew_s + step / 50.0)
        assert not boot.is_doubtful
    assert boot.boot_s == pytest.approx(silence_s + 99 / 50.0)
    assert run(boot, 0.5, anew_s + 30.0, 1.0) == 1  # a true one after that


def test_a_pose_goes_on_while_the_milliseconds_begin_anew() -> None:
    harness = Harness()
    for step in range(100):
        harness.now_s = step / 50.0
        message = position(harness.now_s)
        message.time_boot_ms = ((1 << 32) - 1000 + step * 20) % (1 << 32)
        harness.receive(heartbeat(), attitude(), message)
        motion = harness.snapshot().motion
        assert motion.pose.time_s == harness.now_s
        assert motion.stamp_s == pytest.approx(UTC_S + harness.now_s, abs=0.01)
    assert harness.discovery.link_statistics(harness.now_s).reboots_count == 0


def test_milliseconds_that_begin_anew_show_no_second_vehicle_where_messages_come_late() -> None:
    harness, pose_late_ms = Harness(), 180
    harness.receive(heartbeat())
    for boot_ms in range(-1000, 1000, 20):
        harness.run(0.02, step_s=0.02)
        message = attitude()
        message.time_boot_ms = boot_ms % (1 << 32)
        late = position(0.0)
        late.time_boot_ms = (boot_ms - pose_late_ms) % (1 << 32)
        harness.receive(late, message)
        assert not harness.session.identity.conflict


def test_a_simulator_may_run_much_faster_than_our_clock() -> None:
    boot = BootTime()
    assert sum(boot.update(10.0 + step * 0.5, step * 0.02) for step in range(1000)) == 0
    assert boot.boot_s == 10.0 + 999 * 0.5


def test_a_time_that_leaps_ahead_and_stays_there_is_followed_and_is_no_reboot() -> None:
    boot = BootTime()
    run(boot, 100.0, 0.0, 1.0)
    assert run(boot, 5000.0, 1.0, 1.0) == 0
    assert boot.boot_s > 5000.0


def test_forged_times_discard_nothing_and_are_not_logged(caplog: pytest.LogCaptureFixture) -> None:
    harness, noise = Harness(), random.Random(1)
    harness.receive(heartbeat())
    harness.session.telemetry.parameters["MPC_XY_VEL_MAX"] = 5.0
    with caplog.at_level(logging.WARNING):
        for _ in range(500):
            harness.now_s += 0.02
            harness.receive(attitude_at(harness.now_s), position(harness.now_s))
            for _ in range(5):
                wild = attitude_at(harness.now_s)
                wild.time_boot_ms = noise.randrange(1, 1 << 32)
                harness.receive(wild)
    assert harness.supervision.watch.reboots_count == 0
    assert harness.session.telemetry.parameters["MPC_XY_VEL_MAX"] == 5.0
    assert not [record for record in caplog.records if "rebooted" in record.message]


def attitude_at(now_s: float) -> Message:
    message = attitude()
    message.time_boot_ms = BOOT_MS + int(now_s * 1000)
    return message


@pytest.mark.parametrize(("boot_s", "is_reboot"), [(20.0, True), (33.5, True), (45.0, False), (44.0, False)])
def test_what_ran_for_less_than_the_silence_before_it_has_booted_in_it(boot_s: float, is_reboot: bool) -> None:
    boot = BootTime()
    assert not boot.update(10.0, now_s=100.0)
    believed = [boot.update(boot_s + after_s, now_s=135.0 + after_s) for after_s in (0.0, 0.02, 0.04)]
    assert believed == [False, False, is_reboot]


def test_a_message_with_the_time_of_an_earlier_report_is_of_this_boot() -> None:
    """PX4 stamps GIMBAL_MANAGER_INFORMATION with when it found the gimbal, and its status with the gimbal's report."""
    harness = Harness()
    harness.receive(heartbeat())
    for step in range(120):
        harness.run(0.05)
        harness.receive(attitude(), position(60.0 + harness.now_s))
        if step % 20 == 0:
            harness.receive(
                heartbeat(),
                mavlink.MAVLink_gimbal_manager_information_message(8000, 0xFFF, 1, 0.0, 0.0, -1.0, 0.5, -1.0, 1.0),
                mavlink.MAVLink_gimbal_manager_status_message(9000, 0, 1, 1, 190, 0, 0),
            )
    assert not harness.session.identity.conflict
    assert [each.device_id for each in harness.discovery.protocols.gimbals.found] == [1]
