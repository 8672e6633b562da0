"""Interference of others with simulated autopilots that UAL flies: the twins of `tests/sitl/test_others.py` and its
failsafes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from threading import Thread

import pytest
from pymavlink.dialects.v20 import all as mavlink
from typing_extensions import override

from tests.conftest import LIMIT_S
from tests.simulators import ArduPilot, BadLink, MemoryPort, Px4, ardupilot, px4
from tests.simulators.autopilot import Sticks
from tests.simulators.lockstep import ADDRESS, LockstepBackend, MemoryLink
from tests.ual_daemon.backends.mavlink.test_autopilot_authority import GroundStation
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import ASKING, HEIGHT_M, Flight
from ual.errors import TaskAbortedError, UalError, WrongStateError
from ual.types import State, Telemetry
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions, UpdateCallback
from ual_daemon.backends.firmwares.ardupilot import ArduCopter
from ual_daemon.backends.mavlink.links import LinkConnection
from ual_daemon.backends.mavlink.links.base import Chunk
from ual_daemon.backends.values import Cause

OWN_HOLD = {"px4": (4.0, 3.0), "ardupilot": (17.0, 0.0)}
"""AUTO.LOITER and BRAKE, in the words of DO_SET_MODE."""
NOTICED_S = 0.1
IDLE_ID = 192
"""The component that the second daemon is."""


@pytest.fixture(params=["px4", "ardupilot"])
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def flight(kind: str) -> Iterator[Flight]:
    flight = Flight(kind)
    yield flight
    flight.uav.close()


def hold_by_station(flight: Flight, kind: str) -> None:
    """A ground station makes the autopilot hold by itself."""
    params = (float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED), *OWN_HOLD[kind], 0.0, 0.0, 0.0, 0.0)
    command = mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, *params)
    GroundStation(flight).send(command)
    flight.wait_for_state(State.FLYING_MANUAL)


def setpoints_since(flight: Flight, time_s: float) -> list[float]:
    return [each for each in list(flight.autopilot.setpoints_s) if each > time_s + NOTICED_S]


def held_by(flight: Flight) -> str:
    health = flight.uav.telemetry().health
    return "" if health is None else health.held_by


def test_a_ground_station_that_makes_it_hold_is_named_and_land_ends_the_flight(flight: Flight, kind: str) -> None:
    flight.take_off()
    task = flight.uav.go_to_waypoint(flight.goal(40.0, 0.0), blocking=False)
    flight.let_pass(3.0)
    hold_by_station(flight, kind)
    with pytest.raises(TaskAbortedError) as caught:
        task.wait(LIMIT_S)
    assert caught.value.metadata["by"] == "ground station"
    since_s = flight.now_s
    flight.let_pass(2.0)
    assert setpoints_since(flight, since_s) == []
    assert flight.uav.state() is State.FLYING_MANUAL
    flight.uav.land()  # out of the autopilot's own mode
    flight.wait_for_state(State.LANDED_DISARMED)


def test_a_ground_station_is_named_soon_after_a_command_of_ours_for_another_mode(flight: Flight, kind: str) -> None:
    flight.take_off()
    flight.autopilot.pilot_take_over()
    flight.wait_for_state(State.FLYING_MANUAL)
    flight.let_pass(1.0)
    flight.uav.recover_from_manual()
    task = flight.uav.go_to_waypoint(flight.goal(60.0, 0.0), blocking=False)
    flight.let_pass(1.5)  # the pilot's switch, which has moved, does not explain it any more
    hold_by_station(flight, kind)
    with pytest.raises(TaskAbortedError) as caught:
        task.wait(LIMIT_S)
    assert caught.value.metadata["by"] == "ground station"
    assert held_by(flight) == "ground station"


def test_a_pilot_who_ends_a_failsafe_is_named_and_not_the_failsafe() -> None:
    flight = Flight("ardupilot")
    try:
        flight.take_off()
        autopilot = flight.autopilot
        assert isinstance(autopilot, ArduPilot)
        autopilot.trigger_failsafe("fence")
        flight.wait_for(lambda: held_by(flight) == "fence", "its failsafe")
        flight.let_pass(0.4)
        autopilot.pilot_take_over()
        flight.wait_for(lambda: flight.uav.telemetry().flight_mode == "LOITER", "the pilot's mode")
        flight.let_pass(3.0)
        autopilot.end_failsafe()
        flight.let_pass(3.0)
        assert held_by(flight) == "safety pilot"
        flight.uav.recover_from_manual()
    finally:
        flight.uav.close()


@pytest.mark.parametrize("text", ["Circle fence breached", "Max Alt, Circle fences breached"])
def test_ardupilots_texts_of_one_and_of_several_fences_are_known(text: str) -> None:
    assert ArduCopter().cause_of_text(text) is Cause.FENCE


class OnAnotherLink(Flight):
    """An ArduCopter with a second link, for a daemon that does not step it."""

    def __init__(self) -> None:
        self.port, self.second_port = MemoryPort(), MemoryPort()
        self.link = BadLink(self.port, 0)
        self.autopilot = ArduPilot([self.link, self.second_port])
        self.start()


class Listening(LinkConnection):
    """The link of a daemon beside the one that steps the autopilot: it waits for what comes."""

    def __init__(self, port: MemoryPort) -> None:
        super().__init__(MemoryLink(port), "the second link of a simulated autopilot")
        self._port = port

    @override
    def receive(self, timeout_s: float, now_s: float) -> list[Chunk]:
        time.sleep(0.002)  # its thread has nothing else to wait for
        return [(self._port.sent.popleft()[1], ADDRESS) for _ in range(min(64, len(self._port.sent)))]


class Second(LockstepBackend):
    """The backend of the second daemon."""

    @override
    def open(self, on_update: UpdateCallback) -> None:
        self._start(Listening(self._port), on_update)


def test_a_second_idle_daemon_on_another_link_leaves_the_others_go_to_alone() -> None:
    """The recipe: a second, idle daemon froze the first one's go-to, and put it into BRAKE when it ended."""
    flight = OnAnotherLink()
    try:
        flight.take_off()
        goal = flight.goal(60.0, 0.0)
        task = flight.uav.go_to_waypoint(goal, max_speed_m_s=3.0, blocking=False)
        flight.let_pass(1.0)
        settings = {"component_id": IDLE_ID}
        backend = Second(BackendOptions("uav_1", settings=settings), flight.autopilot, flight.second_port)
        with UAL(backend) as second:
            flight.wait_for(lambda: second.state() is State.FLYING_AUTO, "the state of the second")
            flight.let_pass(2.0)
            assert not task.done()
        task.wait(LIMIT_S)
        assert (flight.uav.pose().pose.position - goal.position).norm() < 0.5
        assert flight.uav.state() is State.FLYING_AUTO
        assert flight.autopilot.setpoint_senders.count((1, IDLE_ID)) == 0
        orders = {command for _, command, _, sender in flight.autopilot.commands if sender == (1, IDLE_ID)}
        assert orders - ASKING == set()
        flight.land()
    finally:
        flight.uav.close()


def test_return_to_launch_ends_a_flight_that_the_autopilot_holds_and_never_one_that_the_pilot_flies(
    flight: Flight, kind: str
) -> None:
    flight.take_off()
    home = flight.uav.pose().pose.position
    flight.uav.go_to_waypoint(flight.goal(8.0, 0.0))
    flight.autopilot.pilot_take_over()
    flight.wait_for_state(State.FLYING_MANUAL)
    mode = flight.uav.telemetry().flight_mode
    for command in (flight.uav.land, flight.uav.return_to_launch):
        with pytest.raises(WrongStateError, match="the safety pilot flies"):
            command()
    assert flight.uav.telemetry().flight_mode == mode
    flight.uav.recover_from_manual()
    hold_by_station(flight, kind)
    flight.uav.return_to_launch(height_m=HEIGHT_M + 1.0)
    assert (flight.uav.pose().pose.position - home).horizontal_norm() < 0.5
    flight.wait_for_state(State.LANDED_DISARMED)


def test_a_lost_position_ends_the_task_is_reported_and_only_force_leaves_its_failsafe(flight: Flight) -> None:
    flight.take_off()
    task = flight.uav.go_to_waypoint(flight.goal(80.0, 0.0), max_speed_m_s=2.0, blocking=False)
    flight.let_pass(2.0)
    flight.autopilot.lose_gps()
    with pytest.raises(TaskAbortedError) as caught:
        task.wait(LIMIT_S)
    ended_s = flight.now_s
    assert caught.value.metadata["by"] in ("autopilot", "position failsafe")
    flight.wait_for(lambda: held_by(flight) == "position failsafe", "its failsafe")
    flight.autopilot.find_gps()
    flight.wait_for_state(State.FLYING_MANUAL, State.LANDING)
    with pytest.raises(WrongStateError, match=r"position failsafe|LANDING"):
        flight.uav.recover_from_manual()
    assert setpoints_since(flight, ended_s) == []
    assert flight.commands_since(ended_s) == set()


FLYING = (mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_TAKEOFF)


NAMES = {"return": {"px4": "AUTO.RTL", "ardupilot": "RTL"}, "hold": {"px4": "AUTO.LOITER", "ardupilot": "BRAKE"}}


def call(command: Callable[[], object]) -> None:
    """Calls what ends with an error once others took over; what follows is judged by the autopilot."""
    with suppress(UalError):
        command()


def choose(flight: Flight, mode: str) -> None:
    """The pilot's switch, or a ground station, chooses one of the autopilot's own modes."""
    autopilot = flight.autopilot
    if isinstance(autopilot, ArduPilot):
        autopilot.set_mode({"return": ardupilot.RTL, "hold": ardupilot.BRAKE}[mode])
    else:
        assert isinstance(autopilot, Px4)
        assert autopilot.request_mode({"return": px4.RTL, "hold": px4.LOITER}[mode])


def be_armed_by_sticks(flight: Flight) -> None:
    flight.wait_for_state(State.LANDED_DISARMED)
    autopilot = flight.autopilot
    if isinstance(autopilot, Px4):
        autopilot.pilot_moves(Sticks())
        assert autopilot.request_mode(px4.POSCTL)
    else:
        assert isinstance(autopilot, ArduPilot)
        autopilot.set_mode(ardupilot.LOITER)
    assert autopilot.pilot_arm()
    flight.wait_for_state(State.LANDED_ARMED)
    flight.let_pass(1.5)


@pytest.mark.parametrize("chosen", ["return", "hold"])
@pytest.mark.parametrize("name", ["land", "recover_from_manual", "take_off"])
def test_a_command_that_was_lost_is_not_sent_again_into_a_mode_that_others_chose(
    flight: Flight, name: str, chosen: str
) -> None:
    """The recipe: for 0.4 s after the mode was seen the command was sent again, and replaced the pilot's mode."""
    autopilot, uav = flight.autopilot, flight.uav
    if name == "take_off":
        be_armed_by_sticks(flight)
    else:
        flight.take_off()
    if name == "recover_from_manual":
        autopilot.pilot_take_over()
        flight.wait_for_state(State.FLYING_MANUAL)
        flight.let_pass(1.0)
    autopilot.ignored.update(FLYING)
    mode = NAMES[chosen]["px4" if isinstance(autopilot, Px4) else "ardupilot"]
    before_s = flight.now_s
    chosen_s: list[float] = []

    def act(telemetry: Telemetry) -> None:
        if not chosen_s and flight.commands_since(before_s):
            chosen_s.append(flight.now_s)
            choose(flight, chosen)
        elif chosen_s and telemetry.flight_mode == mode:
            autopilot.ignored.clear()

    flight.uav.vehicle.subscribe(act)
    calls = {"land": uav.land, "recover_from_manual": uav.recover_from_manual, "take_off": lambda: uav.take_off(3.0)}
    caller = Thread(target=call, args=(calls[name],), daemon=True)
    caller.start()
    flight.wait_for(lambda: bool(chosen_s) and not autopilot.ignored, "the mode that others chose")
    flight.let_pass(3.0)
    assert uav.telemetry().flight_mode == mode
    assert len([each for each in autopilot.commands if each[0] >= before_s and each[1] in FLYING]) == 1


def test_the_hold_of_a_shutdown_is_not_sent_again_into_a_landing_that_others_began(flight: Flight) -> None:
    flight.take_off()
    autopilot = flight.autopilot
    autopilot.ignored.add(mavlink.MAV_CMD_DO_SET_MODE)
    before_s = flight.now_s
    landed: list[float] = []

    def act(telemetry: Telemetry) -> None:
        if not landed and flight.commands_since(before_s):
            landed.append(flight.now_s)
            if isinstance(autopilot, ArduPilot):
                autopilot.set_mode(ardupilot.LAND)
            else:
                assert isinstance(autopilot, Px4)
                assert autopilot.request_mode(px4.LAND)
        elif landed and telemetry.state is State.LANDING:
            autopilot.ignored.clear()

    flight.uav.vehicle.subscribe(act)
    done = flight.uav.vehicle.prepare_shutdown()
    flight.wait_for(lambda: bool(landed) and not autopilot.ignored, "the landing")
    flight.let_pass(2.0)
    assert done.done()
    assert flight.uav.state() is State.LANDING
    assert len([each for each in autopilot.commands if each[0] >= before_s and each[1] in FLYING]) == 1
