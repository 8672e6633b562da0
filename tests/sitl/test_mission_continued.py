"""Missions across what happens to them: a killed daemon, a stream of velocities, a pilot, two aborts."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from time import monotonic

import pytest

import ual
from tests.conftest import DaemonProcess, StartDaemon
from tests.sitl.doing import HEIGHT_M, Doing, take_off, waypoints
from tests.sitl.flights import PATIENCE_S, Flight
from tests.sitl.simulators import Simulator
from tests.sitl.transmitter import Transmitter
from tests.sitl.troubles import trouble
from tests.sitl.wiretap import Wiretap
from ual.errors import TaskAbortedError, UalError
from ual.geometry import Twist, Vector3
from ual.missions import MissionStage, TakeOff
from ual.types import State
from ual_daemon import UAL

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]

TOLD_S = 1.5
RATE_S = 0.05


@pytest.mark.usefixtures("lands_in_the_end")
def test_a_mission_that_was_paused_is_resumed_by_the_next_daemon(
    tapped_daemon: DaemonProcess, start_daemon: StartDaemon, wiretap: Wiretap, pilot: Transmitter
) -> None:
    with ual.Uav(address=tapped_daemon.address) as uav:
        flight = Flight(uav, pilot)
        take_off(flight, Doing(), "mission")
        uav.mission.upload([*waypoints(flight, 1, 0)])
        uav.mission.start()
        flight.wait_for_speed(1.0)
        uav.mission.pause()
        flight.wait_for(lambda: uav.mission.progress().stage is MissionStage.PAUSED, "its pause")
        tapped_daemon.signal(signal.SIGKILL)
        tapped_daemon.wait()
    second = start_daemon("--url", wiretap.url, "--allow-arming", backend="mavlink")
    with ual.Uav(address=second.address) as uav:
        flight = Flight(uav, pilot)
        flight.wait_for(lambda: bool(uav.mission.progress().task_id), "its mission", 15.0)
        task = uav.task(uav.mission.progress().task_id)
        uav.mission.resume()
        flight.wait_for_speed(1.0)
        task.wait(PATIENCE_S)
        uav.land()
        flight.wait_for_state(State.LANDED_DISARMED)


@contextmanager
def streaming(uav: UAL) -> Iterator[list[UalError]]:
    """Streams velocities until the end of the block; `refused` are the errors that they end with."""
    is_over, refused = threading.Event(), list[UalError]()

    def stream() -> None:
        while not is_over.wait(RATE_S):
            try:
                uav.set_velocity(Twist(Vector3(0.0, 0.5, 0.0)))
            except UalError as error:
                refused.append(error)

    thread = threading.Thread(target=stream, name="velocities")
    thread.start()
    try:
        yield refused
    finally:
        is_over.set()
        thread.join()


def test_velocities_that_stream_at_its_start_do_not_replace_it(flight: Flight, uav: UAL) -> None:
    flight.take_off()
    uav.mission.upload([*waypoints(flight, 0.5, 0)])
    with streaming(uav) as refused:
        flight.wait_for(lambda: uav.velocity().twist.linear.norm() > 0.3, "its velocity")
        task = uav.task(uav.mission.start().id)
        task.wait(PATIENCE_S)
    assert refused
    uav.abort()


def test_a_pilot_who_takes_over_just_after_a_start_on_the_ground_is_named(
    flight: Flight, uav: UAL, pilot: Transmitter
) -> None:
    flight.be_armed()
    uav.mission.upload([TakeOff(HEIGHT_M), *waypoints(flight, 0.5)])
    pilots_mode = uav.telemetry().flight_mode  # PX4 stands in the mode that the pilot selects again
    task = uav.task(uav.mission.start().id)
    flight.wait_for(lambda: uav.telemetry().flight_mode != pilots_mode, "the mission's mode")
    threading.Event().wait(0.3)  # what is tested is this time after the start
    pilot.take_over()
    with pytest.raises(TaskAbortedError) as caught:
        task.wait(PATIENCE_S)
    print(f"{pilot.autopilot}: {caught.value}")
    assert caught.value.metadata["by"] == "safety pilot"
    with suppress(UalError):
        pilot.disarm()


def test_two_aborts_in_its_take_off_are_accepted(flight: Flight, uav: UAL) -> None:
    flight.be_armed()
    uav.mission.upload([TakeOff(HEIGHT_M), *waypoints(flight, 0.5)])
    task = uav.task(uav.mission.start().id)
    flight.wait_for(lambda: uav.velocity().twist.linear.z > 0.3, "its climb")
    uav.abort()
    uav.abort()
    with pytest.raises(TaskAbortedError):
        task.wait(PATIENCE_S)
    flight.wait_for_state(State.FLYING_AUTO)


@pytest.mark.parametrize("after_s", [0.0, 0.1, 0.2, 0.5])
def test_one_that_starts_just_after_a_jump_to_the_last_item_is_executed(
    flight: Flight, uav: UAL, after_s: float
) -> None:
    """A PX4 that hovers there may end the mission at once, and hold by itself."""
    flight.take_off()
    uav.mission.upload([*waypoints(flight, 0.5, 0)])
    uav.mission.start()
    flight.wait_for(lambda: uav.mission.progress().stage is MissionStage.ACTIVE, "its mission")
    jump = Doing()
    jump.begin(lambda: uav.mission.jump_to(2))
    threading.Event().wait(after_s)  # what is tested is this time after the jump
    task = uav.task(uav.mission.start().id)
    jump.join()
    task.wait(PATIENCE_S)


def test_a_battery_failsafe_is_named_while_nothing_is_commanded(
    flight: Flight, uav: UAL, simulator: Simulator, pilot: Transmitter
) -> None:
    flight.take_off()
    with trouble(pilot, simulator.autopilot, "battery failsafe"):

        def holder() -> str:
            health = uav.telemetry().health
            return "" if health is None else health.held_by

        flight.wait_for(lambda: bool(holder()), "its failsafe")
        since_s = monotonic()
        flight.wait_for(lambda: holder() == "battery failsafe" or monotonic() - since_s > TOLD_S, "its name")
        print(f"{simulator.autopilot}: {holder()}: {uav.telemetry().state_reason}")
        assert holder() == "battery failsafe"
        uav.recover_from_manual(force=True)
        uav.land()
    flight.wait_for_state(State.LANDED_DISARMED)
