"""A take-off where the topics of the mode and of the authority do not come in step."""

from __future__ import annotations

from functools import partial

import pytest

from tests.simulators.dji import ENGINE_START, P_GPS, Psdk
from tests.simulators.lockstep_dji import LockstepDji, LockstepOsdk, LockstepOsdkVehicle, LockstepPsdk
from tests.ual_daemon.backends.dji.take_over import take_over_in_take_off
from tests.ual_daemon.backends.dji.test_dji_flights import KINDS, fly, ready, wait
from tests.waiting import LIMIT_S, until
from ual.types import State
from ual_daemon.backends.dji import modes
from ual_daemon.backends.dji.settings import DjiSettings
from ual_daemon.backends.dji.telemetry import DjiTelemetry
from ual_daemon.backends.dji.wrappers import WRAPPERS
from ual_daemon.backends.rosbridge import Message
from ual_daemon.backends.values import Control

RATES = [(50.0, 10.0, 0.0), (50.0, 10.0, 0.06), (50.0, 5.0, 0.1), (1.0, 1.0, 0.2), (1.0, 1.0, 0.5), (1.0, 1.0, 0.8)]
"""Rates of the state and of the authority, and when the latter begins."""
REMOTE: Message = {"device_mode": 0, "control_auth": 0}
OURS: Message = {"device_mode": 4, "control_auth": 1}


def published(state_hz: float, authority_hz: float, after_s: float) -> type[LockstepPsdk]:
    """The wrapper with other rates."""

    class Lockstep(LockstepPsdk):
        front = partial(Psdk, state_rate_hz=state_hz, authority_rate_hz=authority_hz, authority_after_s=after_s)

    return Lockstep


@pytest.mark.parametrize("rates", RATES)
@pytest.mark.parametrize("after_s", [0.0, 0.27, 0.55, 0.83])
def test_it_takes_off_where_the_pilot_has_started_the_motors(rates: tuple[float, float, float], after_s: float) -> None:
    with ready(published(*rates)) as (uav, backend):
        backend.simulation().pilot_arm()
        until(lambda: uav.state() is State.LANDED_ARMED)
        wait(backend, after_s)
        uav.take_off(3.0)
        assert uav.state() is State.FLYING_AUTO


@pytest.mark.parametrize("kind", [LockstepOsdk, LockstepOsdkVehicle])
def test_it_takes_off_where_the_pilot_has_started_the_motors_of_an_older_aircraft(kind: type[LockstepDji]) -> None:
    with ready(kind) as (uav, backend):
        backend.simulation().pilot_arm()
        until(lambda: uav.state() is State.LANDED_ARMED)
        uav.take_off(3.0)
        assert uav.state() is State.FLYING_AUTO


@pytest.mark.parametrize("rates", RATES)
def test_it_arms_and_takes_off_at_any_rates(rates: tuple[float, float, float]) -> None:
    with ready(published(*rates)) as (uav, _):
        fly(uav)


@pytest.mark.parametrize("after_s", [0.5, 1.0, 1.5])
def test_a_pilot_who_takes_over_in_such_a_take_off_is_reported_at_once(after_s: float) -> None:
    with ready(published(50.0, 10.0, 0.06), 10.0) as (uav, backend):
        backend.simulation().pilot_arm()
        until(lambda: uav.state() is State.LANDED_ARMED)
        assert take_over_in_take_off(uav, backend, after_s).told_after_s <= 0.25


UNSEEN_S = {LockstepPsdk: 0.2, LockstepOsdk: 0.45, LockstepOsdkVehicle: 1.5}
"""Within this time a take-over is told where the mode does not show it: psdk_ros2 publishes the authority. Else the
first setpoint must have had no effect for 0.4 s, and the newer node takes none for up to a second."""


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("after_s", [0.2, 1.0, 1.6, 2.0, 2.2, 2.3, 2.4, 2.5, 2.7, 3.0, 3.4, 4.2])
def test_the_pilot_takes_over_at_any_time_of_a_take_off(kind: type[LockstepDji], after_s: float) -> None:
    with ready(kind, 40.0) as (uav, backend):
        uav.arm()
        seen = take_over_in_take_off(uav, backend, after_s)
        bound_s = 0.2 if seen.shows_in_mode else UNSEEN_S[kind]
        assert seen.told_after_s <= bound_s
        assert seen.sent_after_s <= bound_s


def test_motors_that_have_just_started_are_no_other_mode() -> None:
    with ready() as (uav, backend):
        backend.bridge.faults.slow_services["/psdk_ros2/obtain_ctrl_authority"] = 0.5
        backend.simulation().pilot_arm()
        with backend.lock:
            backend.aircraft.display = ENGINE_START
            obtain = backend.aircraft.obtain
            backend.aircraft.obtain = lambda: None  # type: ignore[method-assign]
            take_off = backend.aircraft.take_off
            backend.aircraft.take_off = lambda: (obtain(), take_off())  # type: ignore[assignment, method-assign]
        until(lambda: uav.state() is State.LANDED_ARMED)
        task = uav.take_off(3.0, blocking=False)
        wait(backend, 0.2)
        with backend.lock:
            backend.aircraft.display = P_GPS
        task.wait(LIMIT_S)
        assert uav.state() is State.FLYING_AUTO


def issued() -> DjiTelemetry:
    """An aircraft on the ground whose control authority the wrapper gives us at 1 s."""
    telemetry = DjiTelemetry(WRAPPERS[0], DjiSettings())
    telemetry.on_flight_status({"flight_status": modes.ON_GROUND}, 0.9)
    telemetry.on_display_mode({"display_mode": modes.P_GPS}, 0.9)
    telemetry.on_control_mode(REMOTE, 0.9)
    telemetry.note_granted(0.95, 1.0)
    return telemetry


def control(telemetry: DjiTelemetry, now_s: float) -> Control:
    mode = telemetry.snapshot(now_s).control.mode
    assert mode is not None
    return mode.value.control


def test_authority_that_was_passed_counts_before_it_is_published() -> None:
    telemetry = issued()
    assert control(telemetry, 1.0) is Control.REFERENCES
    telemetry.on_control_mode(REMOTE, 1.02)  # said before
    telemetry.on_display_mode({"display_mode": modes.AUTO_TAKE_OFF}, 1.04)
    assert control(telemetry, 1.04) is Control.TAKE_OFF


def test_authority_that_does_not_show_is_lost() -> None:
    telemetry = issued()
    telemetry.on_control_mode(REMOTE, 1.32)
    assert control(telemetry, 1.32) is Control.OTHER


def test_authority_that_has_shown_is_lost_at_once() -> None:
    telemetry = issued()
    telemetry.on_control_mode(OURS, 1.02)
    telemetry.on_control_mode(REMOTE, 1.04)
    assert control(telemetry, 1.04) is Control.OTHER


def test_an_answer_that_comes_after_the_authority_was_lost_gives_nothing() -> None:
    telemetry = issued()
    telemetry.on_control_mode(OURS, 2.0)
    telemetry.on_control_mode(REMOTE, 2.5)
    telemetry.note_granted(1.9, 3.0)
    assert control(telemetry, 3.0) is Control.OTHER
    telemetry.note_granted(3.1, 3.2)
    assert control(telemetry, 3.2) is Control.REFERENCES


def test_what_a_silence_may_hide_is_lost_at_once() -> None:
    telemetry = issued()
    telemetry.discard_state()
    telemetry.on_display_mode({"display_mode": modes.P_GPS}, 1.1)
    telemetry.on_control_mode(REMOTE, 1.1)
    assert control(telemetry, 1.1) is Control.OTHER
