"""A vehicle that nobody can take over: UAL aborts its take-offs and landings, too. In stepped time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

from tests.ual_daemon.stepped import Stepped, stepped
from ual.errors import TaskAbortedError, WrongStateError
from ual.types import State


@pytest.fixture
def with_pilot() -> Iterator[Stepped]:
    with stepped() as uav:
        uav.sim.pilot_arm()
        yield uav


@pytest.fixture
def uav(with_pilot: Stepped, monkeypatch: pytest.MonkeyPatch) -> Stepped:
    backend = with_pilot.vehicle.backend
    info = replace(backend.info(), has_safety_pilot=False)
    monkeypatch.setattr(backend, "info", lambda: info)
    return with_pilot


def test_a_take_off_is_left_to_the_safety_pilot(with_pilot: Stepped) -> None:
    with_pilot.prepare.take_off(3.0).begin()
    with_pilot.run(1.0)
    with pytest.raises(WrongStateError):
        with_pilot.vehicle.commands.abort()


@pytest.mark.parametrize("freeze", [False, True])
def test_a_take_off_that_is_aborted_holds_where_it_is(uav: Stepped, freeze: bool) -> None:
    task = uav.prepare.take_off(3.0).begin()
    uav.until(lambda: uav.pose.position.z > 0.8)
    uav.vehicle.commands.abort(freeze)
    uav.run(3.0)
    assert isinstance(task.future.exception(), TaskAbortedError)
    assert uav.state is State.FLYING_AUTO
    assert 0.8 <= uav.pose.position.z < 1.8  # braked from 1.2 m/s


@pytest.mark.parametrize("how", ["abort", "cancel"])
def test_a_landing_that_is_aborted_is_taken_back_from_the_autopilot(uav: Stepped, how: str) -> None:
    uav.end(uav.prepare.take_off(3.0).begin().future)
    task = uav.prepare.land().begin()
    uav.until(lambda: uav.state is State.LANDING and uav.pose.position.z < 2.0)
    if how == "abort":
        uav.vehicle.commands.abort()
    else:
        uav.vehicle.commands.cancel(task)
    uav.run(3.0)
    assert isinstance(task.future.exception(), TaskAbortedError)
    assert uav.state is State.FLYING_AUTO
    assert uav.pose.position.z > 1.0


def test_another_command_waits_for_the_end_of_a_landing(uav: Stepped) -> None:
    uav.end(uav.prepare.take_off(3.0).begin().future)
    uav.prepare.land().begin()
    uav.until(lambda: uav.state is State.LANDING and uav.pose.position.z < 2.8)
    with pytest.raises(WrongStateError, match="needs the state FLYING_AUTO"):
        uav.prepare.land()
