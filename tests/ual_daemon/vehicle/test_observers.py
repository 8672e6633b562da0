"""Observers of a UAV: a defect of one takes nothing from the flight, from its callers, and from the others."""

from __future__ import annotations

import logging

import pytest

from tests.ual_daemon.stepped import STEP_S, UPDATE_S, stepped
from ual.geometry import Twist, TwistStamped, Vector3
from ual.types import State, Telemetry
from ual_daemon.backends.values import Setpoint


def test_a_watcher_that_fails_keeps_no_sample_and_no_state_from_the_others(caplog: pytest.LogCaptureFixture) -> None:
    def fail(_: object) -> None:
        raise RuntimeError("a defect of a watcher")

    with stepped() as uav:
        uav.update_each_step()
        samples: list[Telemetry] = []
        states: list[State] = []
        uav.vehicle.subscribe(fail)
        uav.vehicle.subscribe(samples.append)
        uav.vehicle.listen_to_state(fail)
        uav.vehicle.listen_to_state(states.append)
        uav.arm()
        uav.run(5 * STEP_S)
        assert states == [State.LANDED_ARMED]
        assert len(samples) == 6
    assert sum(record.levelno == logging.ERROR for record in caplog.records) == 1  # a defect is told once


def test_who_watches_the_setpoints_and_fails_ends_no_command(caplog: pytest.LogCaptureFixture) -> None:
    def fail(_: Setpoint) -> None:
        raise RuntimeError("a defect of a watcher")

    with stepped() as uav:
        seen: list[Setpoint] = []
        uav.vehicle.observe_setpoints(fail)
        uav.vehicle.observe_setpoints(seen.append)
        uav.fly()
        seen.clear()
        uav.vehicle.commands.setpoints.set_velocity(TwistStamped(Twist(Vector3(1.0))))
        assert len(seen) == 1
        uav.run(0.4)
        assert uav.speed > 0.5
    assert sum(record.levelno == logging.ERROR for record in caplog.records) == 1


@pytest.mark.parametrize("part", ["resolver", "missions", "gimbals"])
def test_a_defect_next_to_the_flight_takes_it_no_setpoint_and_is_reported_once(
    part: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(_: object) -> bool:
        raise RuntimeError("a defect beside the flight")

    with stepped() as uav:
        uav.fly()
        vehicle = uav.vehicle
        beside = {"resolver": vehicle._resolver, "missions": vehicle.missions, "gimbals": vehicle.gimbals}[part]
        monkeypatch.setattr(beside, "update", fail)
        monkeypatch.setattr(vehicle.gimbals, "due_s", -1.0)
        seen: list[Setpoint] = []
        vehicle.observe_setpoints(seen.append)
        uav.keep_samples()
        uav.run(10 * UPDATE_S)
        assert len(seen) == len(uav.samples) == 10
    assert sum(record.levelno == logging.ERROR for record in caplog.records) == 1


def test_a_defect_of_the_flight_takes_nobody_the_telemetry_and_is_not_reported_as_one_next_to_it(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(_: object) -> None:
        raise RuntimeError("a defect of the flight")

    with stepped() as uav:
        uav.fly()
        monkeypatch.setattr(uav.vehicle._flight, "step", fail)
        uav.keep_samples()
        uav.run(10 * UPDATE_S)
        assert len(uav.samples) == 10
    (told,) = [record.getMessage() for record in caplog.records if record.levelno == logging.ERROR]
    assert "what flies a UAV failed, and no setpoint is sent while it does" in told
