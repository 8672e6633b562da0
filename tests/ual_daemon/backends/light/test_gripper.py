"""Payload of a light UAV, by a clock of the test."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual.errors import LinkLostError, NotSupportedError, RejectedByAutopilotError
from ual.gripper import GripperState, WinchAction, WinchStatus
from ual_daemon.backends.light.gripper import FALL_M_S, GRIPPER_S, LINE_M, LightGripper
from ual_daemon.backends.offers.gripper import ServoOrder, WinchOrder


class Bench:
    """The devices of a test, and its clock."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.is_link_lost = False
        self.carried = LightGripper(lambda: self.now_s, lambda: self.is_link_lost)

    def winch(self, action: WinchAction, length_m: float | None = None, rate_m_s: float | None = None) -> None:
        self.carried.order_winch(1, WinchOrder(action, length_m, rate_m_s)).result(0)

    @property
    def row(self) -> WinchStatus:
        return self.carried.winch_status(1).result(0)

    def state(self) -> GripperState:
        return self.carried.gripper_state(1).result(0)


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_a_gripper_takes_its_time(bench: Bench) -> None:
    assert bench.state() is GripperState.OPEN
    bench.carried.grip(1).result(0)
    assert bench.state() is GripperState.CLOSING
    bench.now_s += GRIPPER_S
    assert bench.state() is GripperState.CLOSED
    bench.carried.release(1).result(0)
    bench.now_s += 0.6 * GRIPPER_S
    assert bench.state() is GripperState.OPENING
    bench.carried.grip(1).result(0)  # from where it is
    bench.now_s += 0.6 * GRIPPER_S
    assert bench.state() is GripperState.CLOSED
    assert bench.carried.gripper_state(2).result(0) is GripperState.OPEN


def test_a_winch_moves_a_length_and_stays(bench: Bench) -> None:
    assert bench.row.is_fully_retracted
    bench.winch(WinchAction.LENGTH, 2.0, 0.5)
    bench.now_s += 1.0
    assert bench.row.length_m == pytest.approx(0.5)
    assert bench.row.speed_m_s == 0.5
    assert bench.row.is_moving
    bench.now_s += 10.0
    assert (bench.row.length_m, bench.row.speed_m_s) == (2.0, 0.0)
    bench.winch(WinchAction.LENGTH, -5.0)
    bench.now_s += 10.0
    assert bench.row.length_m == 0.0


def test_a_winch_runs_at_a_rate_until_it_is_stopped_or_at_its_end(bench: Bench) -> None:
    bench.winch(WinchAction.RATE, rate_m_s=1.0)
    bench.now_s += 3.0
    bench.winch(WinchAction.RATE, rate_m_s=0.0)
    bench.now_s += 3.0
    assert bench.row.length_m == pytest.approx(3.0)
    bench.winch(WinchAction.RATE, rate_m_s=-0.5)
    bench.now_s += 2.0
    bench.winch(WinchAction.HOLD)
    bench.now_s += 2.0
    assert bench.row.length_m == pytest.approx(2.0)
    bench.winch(WinchAction.RELAX)
    assert bench.row.is_clutch_engaged
    bench.now_s += LINE_M / FALL_M_S
    assert bench.row.length_m == LINE_M


def test_a_winch_locks_only_what_is_taken_in(bench: Bench) -> None:
    bench.winch(WinchAction.ABANDON_LINE)
    bench.now_s += 1.0
    with pytest.raises(RejectedByAutopilotError, match=r"1\.0 m of line are out: retract it first"):
        bench.winch(WinchAction.LOCK)
    bench.winch(WinchAction.RETRACT)
    bench.now_s += 2.0
    bench.winch(WinchAction.LOCK)
    assert bench.row.is_fully_retracted
    with pytest.raises(NotSupportedError, match="cannot DELIVER; it can RELAX"):
        bench.winch(WinchAction.DELIVER)


def test_a_servo_turns_and_a_relay_switches(bench: Bench) -> None:
    bench.carried.set_servo(ServoOrder(9, 1900, 1000, 2000)).result(0)
    bench.now_s += 0.1
    assert bench.carried.servo_pwm_us(9).result(0) == 1700
    bench.now_s += 1.0
    assert bench.carried.servo_pwm_us(9).result(0) == 1900
    assert bench.carried.servo_pwm_us(8).result(0) == 1500
    bench.carried.set_relay(3, is_on=True).result(0)
    assert bench.carried.relay_is_on(3).result(0) is True
    assert bench.carried.relay_is_on(2).result(0) is False


def test_nothing_is_obeyed_or_reported_without_a_link(bench: Bench) -> None:
    bench.is_link_lost = True
    for future in (bench.carried.release(1), bench.carried.gripper_state(1), bench.carried.set_relay(1, is_on=True)):
        with pytest.raises(LinkLostError):
            future.result(0)
    bench.is_link_lost = False
    assert bench.carried.relay_is_on(1).result(0) is False


@given(st.lists(st.tuples(st.floats(-1e3, 1e3), st.floats(0.01, 20.0), st.floats(0.0, 100.0)), max_size=8))
def test_a_row_is_never_longer_than_it_is_nor_faster_than_ordered(
    orders: list[tuple[float, float, float]],
) -> None:
    bench = Bench()
    for length_m, rate_m_s, after_s in orders:
        before_m = bench.row.length_m
        bench.winch(WinchAction.LENGTH, length_m, rate_m_s)
        assert bench.row.length_m == before_m
        bench.now_s += after_s
        now_m = bench.row.length_m
        assert before_m is not None
        assert now_m is not None
        assert 0.0 <= now_m <= LINE_M
        assert abs(now_m - before_m) <= min(abs(length_m), rate_m_s * after_s) + 1e-9
