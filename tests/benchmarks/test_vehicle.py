"""The vehicle of the benchmarks: what it answers, and where it reads the numbers of setpoints."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import all as mavlink

from benchmarks import marks
from benchmarks.vehicle import OWN_FENCE, PARAMETERS, number_of
from ual_daemon.backends.firmwares.px4 import Px4


def test_it_answers_what_ual_reads_of_a_px4() -> None:
    assert set(PARAMETERS) == set(Px4.parameters)
    assert set(OWN_FENCE) <= set(PARAMETERS)


@pytest.mark.parametrize("number", [0, 1, 12_345, marks.SETPOINTS - 1])
def test_the_number_of_a_setpoint_is_read_from_its_speed_or_its_yaw_rate(number: int) -> None:
    packing = mavlink.MAVLink(None)
    for speed, yaw_rate in ((marks.speed_m_s(number), 0.0), (1.7, -marks.yaw_rate_rad_s(number))):
        message = mavlink.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, 1, 0b010111000111, 0, 0, 0, speed, 0, 0, 0, 0, 0, 0, yaw_rate
        )
        assert number_of(message.pack(packing)) == number
