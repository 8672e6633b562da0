"""Meaning of the terminal's keys for `ual teleop keyboard`. Needs neither a terminal nor a daemon."""

from __future__ import annotations

import itertools
from dataclasses import astuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual.types import Limits
from ual_tools.teleop import smoothing, speeds
from ual_tools.teleop.actions import CONFIRMED, Action
from ual_tools.teleop.echo import Echo
from ual_tools.teleop.keyboard import CONFIRM_S, Decoder, Keys, Menu, Steps
from ual_tools.teleop.smoothing import SmoothedAxis
from ual_tools.teleop.stepper import BEGIN_DEFLECTION, REPEAT_S, Stepper
from ual_tools.teleop.sticks import CENTRED, Sticks

UP_ARROW = b"\x1b[A"
TICK_S = 0.02

delays = st.floats(0.2, 0.66)
"""From the press to the first repeat."""
periods = st.floats(0.02, 0.1)
"""From one repeat to the next."""


def held(delay_s: float, period_s: float, duration_s: float) -> list[float]:
    """Returns the times at which the terminal sends a key that is held from 0 to the duration."""
    repeats = itertools.takewhile(lambda t: t <= duration_s, itertools.count(delay_s, period_s))
    return [0.0, *repeats]


def sampled(presses: list[float], until_s: float) -> list[tuple[float, float]]:
    """The deflection of an axis at each tick."""
    axis, waiting, found = SmoothedAxis(), list(presses), []
    for tick in range(round(until_s / TICK_S)):
        now_s = tick * TICK_S
        while waiting and waiting[0] <= now_s:
            axis.press(1.0, waiting.pop(0))
        found.append((now_s, axis.value(now_s)))
    return found


# --- An even deflection out of repeats --------------------------------------------------------------------------------


@given(delays, periods, st.floats(1.5, 4.0))
def test_a_held_key_never_dips_and_reaches_the_full_deflection(delay: float, period: float, duration: float) -> None:
    values = [value for time_s, value in sampled(held(delay, period, duration), duration)]
    assert all(before <= after for before, after in itertools.pairwise(values))
    assert values[-1] == 1.0


@given(delays, periods, st.floats(0.0, 4.0))
def test_a_released_key_stops_soon(delay: float, period: float, duration: float) -> None:
    presses = held(delay, period, duration)
    after_s = smoothing.HELD_KEY_S if len(presses) > 1 else smoothing.TAP_S
    rest = sampled(presses, presses[-1] + 2.0)
    assert all(value == 0.0 for time_s, value in rest if time_s > presses[-1] + after_s + smoothing.FALL_S + TICK_S)


def test_a_tap_moves_little() -> None:
    values = [value for _, value in sampled([0.0], 2.0)]
    assert max(values) == smoothing.TAP_DEFLECTION
    assert sum(values) * TICK_S < 0.25


@given(st.lists(st.tuples(st.floats(0.0, 3.0), st.sampled_from([1.0, -1.0])), max_size=30))
def test_any_keys_stay_within_the_deflection_and_have_no_jump_away_from_the_centre(
    presses: list[tuple[float, float]],
) -> None:
    axis, waiting, last = SmoothedAxis(), sorted(presses), 0.0
    for tick in range(250):
        while waiting and waiting[0][0] <= tick * TICK_S:
            pressed_s, direction = waiting.pop(0)
            axis.press(direction, pressed_s)
        value = axis.value(tick * TICK_S)
        assert -1.0 <= value <= 1.0
        if abs(value) > abs(last):
            assert abs(value) - abs(last) <= TICK_S / smoothing.RISE_S + 1e-9
        last = value
    assert last == 0.0


@given(st.lists(st.floats(0.0, 3.0), min_size=1, max_size=5), st.floats(0.01, 0.2))
def test_how_often_it_is_queried_does_not_matter(presses: list[float], tick_s: float) -> None:
    often, once = SmoothedAxis(), SmoothedAxis()
    for pressed_s in sorted(presses):
        for axis in (often, once):
            axis.press(1.0, pressed_s)
    last_s = max(presses)
    for tick in range(20):
        often.value(last_s + tick * tick_s)
    assert often.value(last_s + 20 * tick_s) == pytest.approx(once.value(last_s + 20 * tick_s))


def test_the_other_key_begins_at_the_centre() -> None:
    axis = SmoothedAxis()
    for pressed_s in held(0.3, 0.03, 2.0):
        axis.press(1.0, pressed_s)
    axis.press(-1.0, 2.01)
    assert -0.1 < axis.value(2.02) <= 0.0


# --- Keys -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "axis", "sign"),
    [
        (b"\x1b[A", "forward", 1),
        (b"\x1bOB", "forward", -1),
        (b"\x1b[D", "left", 1),
        (b"\x1b[C", "left", -1),
        (b"w", "up", 1),
        (b"s", "up", -1),
        (b"a", "turn", 1),
        (b"d", "turn", -1),
    ],
)
def test_each_key_moves_its_axis_alone(key: bytes, axis: str, sign: int) -> None:
    keys = Keys()
    keys.press(key, 0.0)
    sticks = keys.sticks(0.5)
    assert getattr(sticks, axis) == sign * smoothing.TAP_DEFLECTION
    assert sum(map(abs, astuple(sticks))) == smoothing.TAP_DEFLECTION


@given(st.lists(st.sampled_from([b"\x1b[A", b"\x1bOD", b"w", b"t", b" ", b"\x1b[5~"])), st.data())
def test_keys_that_come_in_parts_stay_whole(typed: list[bytes], data: st.DataObject) -> None:
    sent = b"".join(typed)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(sent)), max_size=5)))
    parts = [sent[a:b] for a, b in itertools.pairwise([0, *cuts, len(sent)])]
    decoder = Decoder()
    assert [key for part in parts for key in decoder.keys(part)] == typed


@given(st.binary(max_size=200))
def test_no_bytes_break_the_decoder(read: bytes) -> None:
    decoder = Decoder()
    for key in decoder.keys(read):
        assert key


# --- How late the terminal is -----------------------------------------------------------------------------------------


@given(st.lists(st.sampled_from([b"\x1b[0n", b"\x1b[A", b"w", b"\x1bOD"])), st.data())
def test_answers_are_taken_out_of_the_keys(typed: list[bytes], data: st.DataObject) -> None:
    sent = b"".join(typed)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(sent)), max_size=5)))
    echo = Echo()
    keys = b"".join(echo.filtered(sent[a:b], 0.0) for a, b in itertools.pairwise([0, *cuts, len(sent)]))
    assert keys == sent.replace(b"\x1b[0n", b"")


def test_a_terminal_that_answered_once_is_late_until_it_answers_soon() -> None:
    echo = Echo()
    assert echo.asks(0.0)
    assert not echo.asks(5.0)
    assert echo.lag_s(100.0) == 0.0  # it may never answer
    echo.filtered(b"\x1b[0n", 100.0)
    assert echo.lag_s(100.0) == 100.0
    assert echo.asks(101.0)
    assert echo.is_awaited
    echo.filtered(b"\x1b[0n", 101.1)
    assert echo.lag_s(101.2) == pytest.approx(0.1)
    assert echo.asks(102.0)
    assert echo.lag_s(104.0) == 2.0


# --- Actions ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("key", "action"), [(b"t", Action.TAKE_OFF), (b"r", Action.RECOVER), (b"m", Action.ARM)])
def test_what_is_dangerous_needs_enter(key: bytes, action: Action) -> None:
    menu = Menu()
    assert [menu.action(key, now_s / 30) for now_s in range(100)] == [None] * 100  # held, too
    assert menu.question(3.4) == f"{action.value}? Enter confirms"
    assert menu.action(b"\r", 3.4) is action
    assert menu.action(b"\r", 3.5) is None


def test_a_confirmation_is_for_the_key_before_it_and_for_a_moment() -> None:
    menu = Menu()
    menu.action(b"t", 0.0)
    assert menu.action(b"\r", CONFIRM_S + 0.1) is None
    menu.action(b"t", 10.0)
    assert menu.action(b"w", 10.1) is None
    assert menu.action(b"\r", 10.2) is None
    assert {Action.TAKE_OFF, Action.RECOVER, Action.ARM} == CONFIRMED


@pytest.mark.parametrize(("key", "action"), [(b"l", Action.LAND), (b" ", Action.STOP), (b"x", Action.ABORT)])
def test_what_ends_a_flight_needs_one_key(key: bytes, action: Action) -> None:
    assert Menu().action(key, 0.0) is action


# --- Steps ------------------------------------------------------------------------------------------------------------


def test_each_press_is_a_step_and_a_held_key_two_a_second() -> None:
    steps = Steps()
    assert [steps.step(UP_ARROW, now_s).forward for now_s in (0.0, 0.2, 0.4, 5.0)] == [1.0] * 4
    count = sum(steps.step(UP_ARROW, 10.0 + now_s).forward for now_s in held(0.5, 0.033, 3.0))
    assert count == pytest.approx(6.0, abs=1.0)
    assert steps.step(b"q", 20.0) == CENTRED


@given(st.lists(st.floats(-1.0, 1.0), max_size=100))
def test_a_deflection_that_is_held_makes_two_steps_a_second_at_most(values: list[float]) -> None:
    stepper = Stepper()
    steps = [stepper.steps(Sticks(forward=value), tick * 0.05).forward for tick, value in enumerate(values)]
    for tick, step in enumerate(steps):
        if step:
            assert step * values[tick] >= BEGIN_DEFLECTION or values[tick] * step > 0.0
    up = [tick for tick, step in enumerate(steps) if step > 0.0]
    for first, then in itertools.pairwise(up):
        between = values[first:then]
        assert (then - first) * 0.05 >= REPEAT_S - 1e-9 or min(between) < BEGIN_DEFLECTION


# --- Speeds -----------------------------------------------------------------------------------------------------------

stick = st.floats(-1.0, 1.0)


@given(st.sampled_from(speeds.LEVELS), stick, stick, stick, stick)
def test_no_deflection_is_beyond_the_level_and_the_limits(
    level: speeds.SpeedLevel, forward: float, left: float, up: float, turn: float
) -> None:
    limits = Limits()
    twist = level.within(limits).twist(Sticks(forward, left, up, turn))
    assert twist.linear.horizontal_norm() <= min(level.horizontal_m_s, limits.horizontal_speed_m_s) + 1e-9
    assert abs(twist.linear.z) <= min(level.vertical_m_s, limits.climb_speed_m_s, limits.descent_speed_m_s)
    assert abs(twist.angular.z) <= limits.yaw_rate_rad_s
    assert all(a * b >= 0.0 for a, b in zip(twist.linear, (forward, left, up), strict=True))


def test_each_level_is_faster_than_the_one_before() -> None:
    for slow, fast in itertools.pairwise(speeds.LEVELS):
        assert all(a < b for a, b in zip(astuple(slow), astuple(fast), strict=True))
