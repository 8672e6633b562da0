"""Late requests are refused, by clocks that a test sets."""

from __future__ import annotations

import pytest

import ual
from ual_ros2.lateness import COMMAND_S, QUEUED_S, SETPOINT_S, LatenessCheck, ProgramPulse

NOW_S = 1_000_000.0


class Clock:
    now_s = NOW_S

    def __call__(self) -> float:
        return self.now_s


@pytest.mark.parametrize("age_s", [0.0, 0.4, -0.4])
def test_a_setpoint_of_the_present_is_taken(age_s: float) -> None:
    LatenessCheck(True, Clock()).require_setpoint(NOW_S - age_s, NOW_S - age_s)


def test_a_time_that_is_not_known_is_not_checked() -> None:
    LatenessCheck(True, Clock()).require_setpoint(0.0, 0.0)
    LatenessCheck(True, Clock()).require_command(0.0)


@pytest.mark.parametrize(
    ("sent_s", "stamp_s", "text"),
    [
        (NOW_S - SETPOINT_S - 0.1, 0.0, "it was sent more than 0.5 s ago: it is not flown"),
        (NOW_S, NOW_S - 86_400.0, "it is stamped more than 0.5 s ago"),
        (NOW_S, NOW_S + 2.0, "it is stamped more than 0.5 s in the future"),
    ],
)
def test_a_setpoint_of_another_time_is_refused(sent_s: float, stamp_s: float, text: str) -> None:
    with pytest.raises(ual.UalTimeoutError, match=text) as refused:
        LatenessCheck(True, Clock()).require_setpoint(sent_s, stamp_s)
    assert refused.value.metadata["limit_s"] == "0.5"
    LatenessCheck(False, Clock()).require_setpoint(sent_s, stamp_s)


def test_a_stamp_of_another_time_than_the_simulated_one_learns_it() -> None:
    lateness = LatenessCheck(True, Clock(), lambda: True)
    with pytest.raises(ual.UalTimeoutError, match=r"not the simulated one of this node .* give its"):
        lateness.require_setpoint(NOW_S, NOW_S + 1e9)
    with pytest.raises(ual.UalTimeoutError, match="the clocks of the two computers differ"):
        lateness.require_setpoint(NOW_S - 1.0, NOW_S)


def test_an_old_request_is_refused() -> None:
    lateness = LatenessCheck(True, Clock())
    lateness.require_command(NOW_S - COMMAND_S + 0.1)
    with pytest.raises(ual.UalTimeoutError, match="it was sent more than 3 s ago") as refused:
        lateness.require_command(NOW_S - 5.0)
    assert refused.value.metadata["age_s"] == "5.000"


def test_what_comes_after_the_node_stood_still_is_refused_for_a_while() -> None:
    clock = Clock()
    pulse = ProgramPulse(clock)
    clock.now_s += COMMAND_S - 0.1
    pulse.require_running()
    clock.now_s += 5.0
    for _ in range(2):
        with pytest.raises(ual.UalTimeoutError, match=r"the node stood still for 5\.0 s"):
            pulse.require_running()
    for _ in range(10):
        clock.now_s += QUEUED_S / 10.0
        pulse.beat()
    pulse.require_running()
