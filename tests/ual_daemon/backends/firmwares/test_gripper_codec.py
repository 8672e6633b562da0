"""Form of an order for each autopilot: no value beyond the allowed ones, and nothing else is moved."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual_daemon.backends.firmwares.gripper_codec import SET_ACTUATOR, SET_SERVO, ArduPilotGripper, Px4Gripper
from ual_daemon.backends.offers.gripper import ServoOrder


@st.composite
def orders(draw: st.DrawFn) -> ServoOrder:
    least = draw(st.integers(500, 2499))
    most = draw(st.integers(least + 1, 2500))
    return ServoOrder(draw(st.integers(1, 6)), draw(st.integers(least, most)), least, most)


@given(orders())
def test_an_actuator_of_px4_is_within_its_range_and_the_others_stay(order: ServoOrder) -> None:
    sent = Px4Gripper("PX4").servo(order)
    assert sent.id == SET_ACTUATOR
    *values, actuator_set = sent.params
    moved = {number: value for number, value in enumerate(values, 1) if not math.isnan(value)}
    assert (list(moved), actuator_set) == ([order.channel], 0.0)
    value = moved[order.channel]
    assert -1.0 <= value <= 1.0
    assert order.min_pwm_us + (value + 1.0) / 2.0 * (order.max_pwm_us - order.min_pwm_us) == pytest.approx(order.pwm_us)


@given(orders())
def test_a_servo_of_arducopter_gets_the_pulse_as_it_is(order: ServoOrder) -> None:
    sent = ArduPilotGripper("ArduPilot").servo(order)
    assert (sent.id, sent.params, sent.holds) == (SET_SERVO, (order.channel, order.pwm_us), False)
