"""The MAVLink backend and simulated autopilots on one clock: what must hold when a pilot, a link or a sensor meddles.

Times are the vehicle's, so that they hold on a busy computer too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.conftest import LIMIT_S
from tests.simulators import ArduPilot, Autopilot, BadLink, Faults, MemoryPort, Px4
from tests.simulators.lockstep import POSE_RATE_HZ, LockstepBackend
from tests.simulators.px4 import LOITER, OFFBOARD, RTL
from tests.waiting import until
from ual.errors import RejectedByAutopilotError, TaskAbortedError, UalTimeoutError
from ual.geometry import Pose
from ual.types import State, Telemetry
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions
from ual_daemon.settings import VehicleSettings

SPEED = 12.0
HEIGHT_M = 3.0
ASKING = {mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE}
SILENT = Faults(is_silent=True)
BAD = Faults(loss=0.3, jitter_s=0.2, corruption=0.1, duplication=0.05)


class Flight:
    """A simulated autopilot, a link to it that can get bad, and the UAV that flies it."""

    settings: VehicleSettings | None = None
    home_file: Path | None = None
    pose_rate_hz = POSE_RATE_HZ

    def __init__(self, kind: str, seed: int = 0) -> None:
        self.port = MemoryPort()
        self.link = BadLink(self.port, seed)
        self.autopilot: Autopilot = Px4(self.link, is_terse=True) if kind == "px4" else ArduPilot(self.link)
        self.start()

    def start(self) -> None:
        """Starts the class that flies it, as a new daemon would."""
        self.seen: list[tuple[float, Telemetry]] = []
        self.started_s = self.now_s
        self.port.sent.clear()
        self.port.arriving.clear()
        options = BackendOptions("uav_1", settings={"pose_rate_hz": self.pose_rate_hz})
        self.backend = LockstepBackend(options, self.autopilot, self.port, SPEED)
        self.uav = UAL(self.backend, settings=self.settings, home_file=self.home_file)
        self.uav.vehicle.subscribe(lambda telemetry: self.seen.append((self.now_s, telemetry)))

    def kill(self) -> None:
        """The daemon is gone in the middle of a flight, without a word to the autopilot."""
        self.backend.close()

    @property
    def now_s(self) -> float:
        return self.autopilot.elapsed_s

    def wait_for(self, condition: Callable[[], bool], what: str) -> None:
        until(condition, what, seen=self.uav.telemetry)

    def wait_for_state(self, *states: State) -> None:
        self.wait_for(lambda: self.uav.state() in states, " or ".join(state.name for state in states))

    def when(self, condition: Callable[[Telemetry], bool], act: Callable[[], None]) -> None:
        """Acts once, in the update that first fulfils a condition: a busy computer cannot miss it."""
        acted: list[Telemetry] = []

        def on_telemetry(telemetry: Telemetry) -> None:
            if not acted and condition(telemetry):
                acted.append(telemetry)
                act()

        self.uav.vehicle.subscribe(on_telemetry)

    def let_pass(self, duration_s: float) -> None:
        until_s = self.now_s + duration_s
        self.wait_for(lambda: self.now_s >= until_s, "time passing")

    def first_s(self, condition: Callable[[Telemetry], bool], after_s: float = 0.0) -> float:
        """Returns the time at which telemetry first fulfilled a condition."""

        def found() -> list[float]:
            return [time_s for time_s, telemetry in list(self.seen) if time_s >= after_s and condition(telemetry)]

        self.wait_for(lambda: bool(found()), "such telemetry")
        return found()[0]

    def states_since(self, after_s: float) -> list[State]:
        """The states since a time, repetitions left out."""
        result: list[State] = []
        for time_s, telemetry in list(self.seen):
            if time_s >= after_s and (not result or result[-1] is not telemetry.state):
                result.append(telemetry.state)
        return result

    def commands_since(self, after_s: float) -> set[int]:
        """Returns the commands to the autopilot, other than to send something."""
        return {command for time_s, command, _, _ in self.autopilot.commands if time_s >= after_s} - ASKING

    def take_off(self) -> None:
        self.wait_for_state(State.LANDED_DISARMED)
        assert self.autopilot.pilot_arm()
        self.wait_for_state(State.LANDED_ARMED)
        self.wait_for(self._is_take_off_planned, "what a take-off needs")  # a bad link may not have brought home yet
        self.uav.take_off(HEIGHT_M)

    def _is_take_off_planned(self) -> bool:
        snapshot = self.backend.snapshot()
        is_placed = snapshot.earth.home_altitude_amsl_m is not None and snapshot.earth.projection is not None
        return is_placed or not isinstance(self.autopilot, ArduPilot)

    def goal(self, dx: float, dy: float, dz: float = 0.0) -> Pose:
        here = self.uav.pose().pose.position
        return Pose.at(here.x + dx, here.y + dy, here.z + dz)

    def land(self) -> None:
        self.uav.land()
        self.wait_for_state(State.LANDED_DISARMED)


class UsualRates(Flight):
    """One whose backend asks for as much as it does by default: for tests of rates, and of how soon it notices."""

    pose_rate_hz = 50.0


@pytest.fixture(params=["px4", "ardupilot"])
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def flight(kind: str) -> Iterator[Flight]:
    flight = Flight(kind)
    yield flight
    flight.uav.close()


def px4_of(flight: Flight) -> Px4:
    assert isinstance(flight.autopilot, Px4)
    return flight.autopilot


def test_a_daemon_that_was_killed_in_flight_and_is_new_tells_the_truth_at_once(flight: Flight, kind: str) -> None:
    flight.take_off()
    flight.uav.go_to_waypoint(flight.goal(60.0, 0.0), blocking=False)
    flight.wait_for(lambda: flight.uav.velocity().twist.linear.norm() > 1.5, "its speed")
    flight.kill()
    flight.autopilot.run(1.8)  # nobody is there
    flight.start()
    flight.wait_for(flight.uav.is_ready, "a state")
    # ArduPilot stays in GUIDED. PX4 returns, and lands once it is above its home.
    expected = State.FLYING_AUTO if kind == "ardupilot" else State.FLYING_MANUAL
    ready_s = flight.first_s(lambda telemetry: telemetry.state is not State.UNINITIALIZED)
    assert ready_s - flight.started_s < 2.0
    assert flight.states_since(ready_s)[0] is expected
    flight.let_pass(1.0)
    assert flight.commands_since(flight.started_s) == set()  # nothing is armed, and no mode changed, unasked
    if kind == "px4":
        assert px4_of(flight).mode == RTL
        assert px4_of(flight).request_mode(LOITER)  # a landing is not replaced: the pilot ends it
        flight.wait_for(lambda: flight.uav.telemetry().flight_mode == "AUTO.LOITER", "the pilot's mode")
        flight.wait_for_state(State.FLYING_MANUAL)
        flight.uav.recover_from_manual()
    assert flight.uav.state() is State.FLYING_AUTO


@pytest.mark.parametrize("seed", range(2))
def test_a_flight_is_completed_over_a_bad_link(kind: str, seed: int) -> None:
    flight = Flight(kind, seed)
    try:
        flight.link.down = flight.link.up = BAD
        flight.take_off()
        goal = flight.goal(6.0, -4.0)
        flight.uav.go_to_waypoint(goal)
        assert (flight.uav.pose().pose.position - goal.position).norm() < 1.0
        flight.land()
        statistics = flight.backend.link_statistics()
        assert statistics.loss == pytest.approx(1.0 - 0.7 * 0.9, abs=0.06)
        assert statistics.corrupt_count > 100
    finally:
        flight.link.down = flight.link.up = Faults()
        flight.uav.close()


def test_px4_is_not_pulled_back_into_offboard_by_itself_when_setpoints_paused() -> None:
    flight = Flight("px4")
    try:
        flight.take_off()
        task = flight.uav.go_to_waypoint(flight.goal(50.0, 0.0), blocking=False)
        flight.let_pass(1.0)
        flight.link.up = SILENT  # what PX4 says is still heard
        with pytest.raises(TaskAbortedError):
            task.wait(LIMIT_S)
        assert px4_of(flight).mode == RTL
        assert px4_of(flight).intention == OFFBOARD  # setpoints would bring it back at once
        flight.link.up = Faults()
        back_s = flight.now_s
        flight.let_pass(2.0)
        assert px4_of(flight).mode == RTL
        assert [each for each in flight.autopilot.setpoints_s if each > back_s] == []
    finally:
        flight.uav.close()


def test_a_short_pause_of_setpoints_does_not_end_a_go_to(flight: Flight) -> None:
    flight.take_off()
    goal = flight.goal(12.0, 0.0)
    task = flight.uav.go_to_waypoint(goal, blocking=False)
    flight.let_pass(1.0)
    flight.link.up = SILENT
    flight.let_pass(0.6)
    flight.link.up = Faults()
    task.wait(LIMIT_S)
    assert (flight.uav.pose().pose.position - goal.position).norm() < 0.5
    flight.land()


def test_a_refused_arming_says_why(flight: Flight, kind: str) -> None:
    flight.wait_for_state(State.LANDED_DISARMED)
    flight.autopilot.arm_refusal = "Accels inconsistent"
    with pytest.raises(RejectedByAutopilotError) as caught:
        flight.uav.arm()
    if kind == "ardupilot":
        assert "Arm: Accels inconsistent" in str(caught.value)
        assert caught.value.metadata["result"] == "FAILED"
    else:  # PX4 tells its words to ground stations only, but everybody that there is a reason
        assert "arm denied resolve failures" in str(caught.value)
        assert caught.value.metadata["result"] == "TEMPORARILY_REJECTED"
    assert flight.uav.state() is State.LANDED_DISARMED


def test_without_satellites_it_is_uninitialized_and_says_why(flight: Flight) -> None:
    flight.take_off()
    lost_s = flight.now_s
    flight.autopilot.lose_gps()
    flight.wait_for_state(State.UNINITIALIZED)
    assert flight.first_s(lambda telemetry: telemetry.state is State.UNINITIALIZED, lost_s) - lost_s < 6.5
    reason = flight.uav.telemetry().state_reason
    assert "no good position" in reason
    flight.wait_for(lambda: not flight.autopilot.is_armed, "its landing by itself")


def test_a_reboot_is_noticed_and_everything_requested_anew(flight: Flight) -> None:
    flight.wait_for_state(State.LANDED_DISARMED)
    if isinstance(flight.autopilot, ArduPilot):
        flight.autopilot.settle_s = 4.0
    flight.autopilot.commands.clear()
    flight.autopilot.reboot()
    booted_s = flight.now_s
    flight.wait_for(lambda: flight.backend.link_statistics().reboots_count == 1, "the reboot in the statistics")
    flight.first_s(lambda telemetry: telemetry.state is State.UNINITIALIZED, booted_s)
    flight.wait_for_state(State.LANDED_DISARMED)
    flight.let_pass(2.0)
    intervals = {params[0] for _, command, params, _ in flight.autopilot.commands if command == 511}
    assert float(mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE) in intervals
    flight.take_off()
    flight.land()


def test_nothing_of_ours_cancels_a_take_off_of_ardupilot_and_one_that_another_cancels_fails() -> None:
    flight = Flight("ardupilot")
    try:
        flight.wait_for_state(State.LANDED_DISARMED)
        assert flight.autopilot.pilot_arm()
        flight.wait_for_state(State.LANDED_ARMED)
        task = flight.uav.take_off(HEIGHT_M, blocking=False)
        flight.wait_for(lambda: bool(flight.commands_since(0.0) & {mavlink.MAV_CMD_NAV_TAKEOFF}), "its take-off")
        assert isinstance(flight.autopilot, ArduPilot)
        assert flight.autopilot.setpoints_s == []  # a setpoint of ours would cancel it
        with flight.autopilot.lock:
            flight.autopilot.cancel_takeoff()
        with pytest.raises(UalTimeoutError, match=r"at 0\.00 m"):  # ArduPilot says nothing
            task.wait(LIMIT_S)
    finally:
        flight.uav.close()


@pytest.mark.parametrize("delay_s", [0.2, 0.4])
def test_a_delay_of_the_link_that_ends_is_no_jump_of_the_estimate(flight: Flight, delay_s: float) -> None:
    """Seed 300011 of the campaign: the positions of the delay came at once, and the go-to ended ("jumped by 1.1 m")."""
    flight.take_off()
    task = flight.uav.go_to_waypoint(flight.goal(60.0, 0.0), blocking=False)
    flight.wait_for(lambda: flight.uav.velocity().twist.linear.norm() > 4.0, "its speed")
    for _ in range(2):
        flight.link.down = Faults(delay_s=delay_s)
        flight.let_pass(2.0)
        flight.link.down = Faults()
        flight.let_pass(1.0)
    task.wait(LIMIT_S)
