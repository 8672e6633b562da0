"""`ual view`: what is asked of the things that a UAV carries, and when, without a page."""

from __future__ import annotations

from typing import Any

from ual.errors import LinkLostError, NotSupportedError, UalError
from ual.gripper import Equipment, GripperInfo, GripperState, RelayInfo, ServoInfo, WinchInfo, WinchStatus
from ual_tools.view.carried import PayloadBoard

ALL = Equipment(
    (GripperInfo("claw", GripperState.CLOSED, "grip"), GripperInfo("hand", note="the autopilot does not say it")),
    (WinchInfo("hook", WinchStatus(2.5, is_healthy=True)),),
    (ServoInfo("door", 1000, 2000, pwm_us=1100, position="open"),),
    (RelayInfo("lamp", "lit", "dark", is_on=False), RelayInfo("horn", "on", "off")),
)


class Gripper:
    """Payload devices, which count how often they are asked."""

    def __init__(self, answer: Equipment | UalError) -> None:
        self.answer = answer
        self.asked_count = 0

    def get_all(self) -> Equipment:
        self.asked_count += 1
        if isinstance(self.answer, UalError):
            raise self.answer
        return self.answer


def poll_once(carried: PayloadBoard, gripper: Gripper, now_s: float, *, is_wanted: bool = True) -> None:
    of_uav: Any = gripper
    carried.poll(of_uav, now_s, is_wanted=is_wanted)


def test_each_device_has_a_path_and_what_is_not_known_is_reported_as_unknown() -> None:
    carried = PayloadBoard()
    poll_once(carried, Gripper(ALL), 0.0)
    assert carried.rows == (
        ("gripper claw", "closed; ordered: grip"),
        ("gripper hand", "unknown; the autopilot does not say it"),
        ("winch hook", "2.5 m out"),
        ("servo door", "open (1100 us)"),
        ("relay lamp", "dark"),
        ("relay horn", "unknown"),
    )


def test_it_is_queried_only_while_a_page_shows_it_and_not_more_often_than_that() -> None:
    carried, gripper = PayloadBoard(), Gripper(ALL)
    poll_once(carried, gripper, 10.0, is_wanted=False)
    assert (gripper.asked_count, carried.rows) == (0, ())
    for now_s in (10.5, 11.0, 12.4, 12.5):
        poll_once(carried, gripper, now_s)
    assert gripper.asked_count == 2
    poll_once(carried, gripper, 13.0, is_wanted=False)
    assert carried.rows == ()  # it may have changed until it is shown again
    poll_once(carried, gripper, 13.5)
    assert (gripper.asked_count, len(carried.rows)) == (3, 6)


def test_what_does_not_answer_is_unknown_and_queried_again() -> None:
    carried, gripper = PayloadBoard(), Gripper(ALL)
    poll_once(carried, gripper, 0.0)
    gripper.answer = LinkLostError("nothing is heard")
    poll_once(carried, gripper, 2.0)
    assert carried.rows == (("carries", "unknown: nothing is heard"),)
    gripper.answer = ALL
    poll_once(carried, gripper, 4.0)
    assert len(carried.rows) == 6


def test_a_uav_that_carries_nothing_is_queried_once() -> None:
    for answer in (Equipment(), NotSupportedError("it has none")):
        carried, gripper = PayloadBoard(), Gripper(answer)
        for now_s in (0.0, 2.0, 4.0):
            poll_once(carried, gripper, now_s)
        assert (gripper.asked_count, carried.rows) == (1, ())
