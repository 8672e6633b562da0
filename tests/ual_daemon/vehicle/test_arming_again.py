"""A take-off after a landing: it works where the UAV is armed by itself, and else says what to do. In stepped time."""

from __future__ import annotations

import pytest

from tests.ual_daemon.stepped import STEP_S, Stepped
from ual.errors import TaskAbortedError, WrongStateError
from ual.simulation import BatteryLow
from ual.types import State, TaskStatus
from ual_daemon.vehicle.commands import Commands


def land(uav: Stepped) -> None:
    uav.end(uav.prepare.land().begin().future)


def test_the_refusal_says_how_to_arm(uav: Stepped, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(WrongStateError, match=r"it is LANDED_DISARMED: not armed; arm it before \(arm, `ual arm`\)"):
        uav.prepare.take_off(3.0)
    monkeypatch.setattr(Commands, "is_arming_allowed", False)
    with pytest.raises(WrongStateError, match=r"its safety pilot arms it .*`ual wait landed_armed`") as refused:
        uav.prepare.take_off(3.0)
    assert refused.value.state == "LANDED_DISARMED"
    assert refused.value.metadata["needed"] == "LANDED_ARMED"


def test_a_take_off_waits_for_the_automatic_arming_and_never_arms(uav: Stepped) -> None:
    uav.vehicle.commands.is_armed_automatically = True
    task = uav.prepare.take_off(3.0).begin()
    uav.run(5.0)
    assert uav.is_in(State.LANDED_DISARMED)
    assert task.info().status is TaskStatus.RUNNING
    uav.sim.pilot_arm()
    uav.end(task.future)
    assert uav.is_in(State.FLYING_AUTO)
    assert uav.pose.position.z == pytest.approx(3.0, abs=0.2)


def test_right_after_a_landing_it_waits_until_it_was_disarmed_and_armed_again(uav: Stepped) -> None:
    uav.vehicle.commands.is_armed_automatically = True
    uav.fly()
    for _ in range(2):
        land(uav)
        assert uav.is_in(State.LANDED_ARMED)
        task = uav.prepare.take_off(3.0).begin()
        uav.until(lambda: uav.is_in(State.LANDED_DISARMED), 5.0)
        uav.run(1.0)
        uav.sim.pilot_arm()
        uav.end(task.future)
        assert uav.is_in(State.FLYING_AUTO)


def test_without_automatic_arming_a_take_off_right_after_a_landing_flies(uav: Stepped) -> None:
    uav.fly()
    land(uav)
    assert uav.is_in(State.LANDED_ARMED)
    uav.end(uav.prepare.take_off(3.0).begin().future)
    assert uav.is_in(State.FLYING_AUTO)


def test_a_take_off_that_waits_can_be_cancelled_and_ends_by_itself(uav: Stepped) -> None:
    uav.vehicle.commands.is_armed_automatically = True
    task = uav.prepare.take_off(3.0).begin()
    uav.run(1.0)
    assert uav.vehicle.commands.abandon(task)
    with pytest.raises(TaskAbortedError, match="cancelled"):
        uav.end(task.future)
    task = uav.prepare.take_off(3.0).begin()
    uav.vehicle.commands.abort(task_id=task.id)  # as a client cancels it
    with pytest.raises(TaskAbortedError, match="cancelled"):
        uav.end(task.future)
    task = uav.prepare.take_off(3.0).begin()
    with pytest.raises(WrongStateError, match="not armed within 15 s"):
        uav.end(task.future, 16.0)
    uav.sim.pilot_arm()
    uav.run(STEP_S)
    assert uav.is_in(State.LANDED_ARMED)


def test_one_that_is_not_armed_in_time_says_which_checks_fail(uav: Stepped) -> None:
    uav.vehicle.commands.is_armed_automatically = True
    uav.sim.begin_fault(BatteryLow(3.0))
    task = uav.prepare.take_off(3.0).begin()
    with pytest.raises(WrongStateError, match=r"not armed within 15 s: it is not ready to arm \(battery\)"):
        uav.end(task.future, 16.0)
