"""The end of the class interface while its UAV cannot be left alone."""

from __future__ import annotations

import gc
import logging
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import ual
import ual_daemon
from ual_daemon import ual as class_interface
from ual_daemon.trajectory.turn import Turn


def test_a_close_that_leaves_a_uav_in_motion_logs_what_it_was_doing(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(class_interface, "_CLOSE_PATIENCE_S", 0.01)
    uav = ual_daemon.UAL(backend_settings={"speed_factor": 0})
    uav.simulation.step(0.1)
    uav.simulation.pilot_arm()
    uav.simulation.step(0.1)
    uav.take_off(100.0, blocking=False)
    uav.simulation.step(10.0)
    with caplog.at_level(logging.ERROR):
        uav.close()
    (record,) = (each for each in caplog.records if vars(each).get("ual_event") == "closed_in_motion")
    fields = record.__dict__["ual_fields"]
    assert fields["state"] == "TAKING_OFF"
    assert fields["task"] == "take_off"
    assert 0.0 < fields["progress"] < 1.0
    assert fields["speed_m_s"] == pytest.approx(1.2, abs=0.1)
    assert "in uav_1/odom" in fields["position"]


@pytest.fixture
def without_collection() -> Iterator[None]:
    gc.disable()
    yield
    gc.enable()


@pytest.mark.usefixtures("without_collection")
def test_a_close_keeps_no_trajectory_alive() -> None:
    """The program ends without a search for garbage, and Ruckig's binding reports each trajectory that is left."""
    before = {id(each) for each in _turns()}
    with ual_daemon.UAL(backend_settings={"speed_factor": 0}) as uav:
        uav.simulation.step(0.1)
        uav.simulation.pilot_arm()
        uav.simulation.step(0.1)
        take_off = uav.take_off(2.0, blocking=False)
        while not take_off.done():
            uav.simulation.step(0.02)
        go_to = uav.go_to_waypoint(ual.Pose.at(50.0, 2.0, 2.0, yaw_rad=1.5), blocking=False)
        uav.simulation.step(1.0)
        assert any(id(each) not in before for each in _turns())
        uav.simulation.set_speed_factor(10.0)
    del go_to
    assert [each for each in _turns() if id(each) not in before] == []


def _turns() -> list[Turn]:
    return [each for each in gc.get_objects() if isinstance(each, Turn)]


@pytest.mark.parametrize(
    "ask",
    [
        lambda uav: uav.state(),
        lambda uav: uav.telemetry(),
        lambda uav: uav.pose(),
        lambda uav: uav.info(),
        lambda uav: uav.frames(),
        lambda uav: uav.subscribe(print),
        lambda uav: uav.land(),
        lambda uav: uav.arm(),
        lambda uav: uav.simulation,
    ],
)
def test_what_is_closed_answers_alike_in_the_class_and_in_the_client(ask: Callable[[Any], object]) -> None:
    closed = ual_daemon.UAL(), ual.Uav("uav_1", address="127.0.0.1:1")
    for uav, name in zip(closed, ("UAL", "client"), strict=True):
        uav.close()
        with pytest.raises(ual.UalError) as caught:
            ask(uav)
        assert type(caught.value) is ual.ClientUnusableError
        assert caught.value.message == f"this {name} is closed"
