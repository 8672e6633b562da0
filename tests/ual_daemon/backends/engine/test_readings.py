"""The order and the age of values, and what a silence and a reboot discard."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual_daemon.backends.engine import contained, readings
from ual_daemon.backends.engine.contained import ErrorBarrier
from ual_daemon.backends.engine.readings import LONGEST_REORDERING_S, Reading, Readings, Valid
from ual_daemon.backends.values import NEVER_S, LandedState, Sample


def test_a_value_is_a_sample_with_the_time_of_its_reception() -> None:
    reading: Reading[bool] = Readings().add(Valid.WHILE_HEARD, limit_s=0.5)
    assert (reading.sample, reading.value, reading.fresh(1.0)) == (None, None, None)
    assert reading.on_value(True, 1.0)
    assert reading.sample == Sample(True, 1.0)
    assert reading.fresh(1.5) is True
    assert reading.fresh(1.6) is None
    assert reading.value is True


def test_a_late_message_is_ignored_unless_its_order_must_be_wrong() -> None:
    readings = Readings()
    mode: Reading[str] = readings.add(Valid.WHILE_HEARD)
    readings.order = 7
    assert mode.on_value("hold", 1.0)
    readings.order = 5
    assert not mode.on_value("manual", 1.1)
    assert mode.value == "hold"
    assert mode.on_value("manual", 1.1 + LONGEST_REORDERING_S)


@given(st.lists(st.integers(0, 30), min_size=1, max_size=30))
def test_whatever_the_order_of_arrival_the_newest_sent_is_what_is_known(numbers: list[int]) -> None:
    readings = Readings()
    reading: Reading[int] = readings.add(Valid.WHILE_HEARD)
    for position, number in enumerate(numbers):
        readings.order = number
        reading.on_value(number, position / 30.0)
    assert reading.value == max(numbers)


def test_each_value_lasts_as_long_as_its_kind() -> None:
    readings = Readings()
    unknown = Sample(LandedState.UNKNOWN, NEVER_S)
    landed: Reading[LandedState] = readings.add(Valid.WHILE_HEARD, unknown=unknown)
    home: Reading[float] = readings.add(Valid.UNTIL_REBOOT)
    battery: Reading[float] = readings.add(Valid.ALWAYS)
    readings.order = 9

    def take() -> None:
        assert landed.on_value(LandedState.IN_AIR, 1.0)
        assert home.on_value(3.0, 1.0)
        assert battery.on_value(50.0, 1.0)

    take()
    readings.discard_state()
    assert (landed.sample, home.value, battery.value) == (unknown, 3.0, 50.0)
    readings.order = 8
    assert not landed.on_value(LandedState.ON_GROUND, 1.1)  # it was sent before what was discarded
    readings.order = 9
    take()
    readings.discard_boot()
    assert (landed.sample, home.value, battery.value) == (unknown, None, 50.0)
    readings.order = 1  # a new boot counts anew
    take()


def test_the_old_names_warn_and_mean_the_same() -> None:
    with pytest.warns(DeprecationWarning, match="Lasts is Valid"):
        lasts: Any = readings.Lasts
    assert lasts.SEEN is Valid.WHILE_HEARD
    assert lasts.BOOT is Valid.UNTIL_REBOOT
    assert lasts.EVER is Valid.ALWAYS
    with pytest.warns(DeprecationWarning, match="Contained is ErrorBarrier"):
        assert contained.Contained is ErrorBarrier
