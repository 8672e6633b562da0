"""Failures of the vehicle in flight: what falls is told, ends what is flown, and stays down when the motors run again.

By the simulator's truth. `docs/evidence/campaign.md` says how often each was flown.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress

import pytest

import ual
from tests.conftest import DaemonProcess, StartDaemon
from tests.sitl.flights import PATIENCE_S, Flight
from tests.sitl.simulators import Simulator
from tests.sitl.transmitter import Transmitter
from tests.sitl.troubles import Change, changed
from tests.sitl.wiretap import Wiretap
from ual.errors import TaskAbortedError, UalError, WrongStateError
from ual.geometry import Pose, Twist, Vector3
from ual.interface import Task
from ual.missions import Waypoint
from ual.types import State, Telemetry
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]

HEIGHT_M = 6.0
TOLD_S = 1.0
FALLS_M_S = 3.0
"""Faster than any descent of these flights."""
STOPPED_S, WATCHED_S = 5.0, 8.0
LEFT_S = 3.0
"""Seconds after the fall at which the daemon is killed: its landing has begun."""
STAYS_M = 0.6
"""Metres that what lies may rise, by a controller that runs up its motors."""
NOT_FOLLOWED = "not follow"
_NO_THRUST = Change("SIH_T_MAX", 0.3, 5.0)
_STOP_FUNCTION, _HIGH, _LOW = 31.0, 2.0, 0.0
_DO_AUX_FUNCTION = 218
_RATE_HZ = 20.0
_FORCE = 21196.0
DISARMED_AT_M = 4.0


class Truth:
    """Vehicle as the simulator has it: height over the place where it stood, and speed of descent."""

    def __init__(self, pilot: Transmitter) -> None:
        self.height_m = self.down_m_s = 0.0
        self._ground_m: float | None = None
        self._pilot = pilot
        self.fell_s: float | None = None
        """Time at which it first fell."""
        self.ask()

    def ask(self) -> None:
        """Asks for the truth, which comes until the autopilot boots."""
        is_px4 = self._pilot.autopilot == "PX4"
        wanted = mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION if is_px4 else mavlink.MAVLINK_MSG_ID_SIM_STATE
        self._pilot.listen(wanted, _RATE_HZ, self._take)

    def _take(self, message: Message) -> None:
        is_px4 = isinstance(message, mavlink.MAVLink_hil_state_quaternion_message)
        altitude_m = message.alt / 1e3 if is_px4 else message.alt
        self.down_m_s = message.vz / 100.0 if is_px4 else message.vd
        if self._ground_m is None:
            self._ground_m = altitude_m
        self.height_m = altitude_m - self._ground_m
        if self.fell_s is None and self.down_m_s > FALLS_M_S:
            self.fell_s = time.monotonic()


@contextmanager
def stopped_motors(pilot: Transmitter) -> Iterator[None]:
    """Has no motor lift it, until the end of the block."""
    if pilot.autopilot == "PX4":
        with changed(pilot, (_NO_THRUST,)):
            yield
        return
    pilot.order(_DO_AUX_FUNCTION, (_STOP_FUNCTION, _HIGH))
    try:
        yield
    finally:
        pilot.order(_DO_AUX_FUNCTION, (_STOP_FUNCTION, _LOW))


class Doing:
    """Manoeuvre that flies when the motors stop, and its end."""

    def __init__(self) -> None:
        self.error: UalError | None = None
        self.ended_s: float | None = None
        self._thread: threading.Thread | None = None

    def begin(self, flown: Callable[[], object]) -> None:
        self._thread = threading.Thread(target=self._run, args=(flown,), name="doing")
        self._thread.start()

    def _run(self, flown: Callable[[], object]) -> None:
        try:
            flown()
        except UalError as error:
            self.error = error
        self.ended_s = time.monotonic()

    def join(self) -> None:
        if self._thread is not None:
            self._thread.join(PATIENCE_S)


def _hover(_: Flight) -> None:
    return None


def _waited(begin: Callable[[], Task]) -> Callable[[], object]:
    task = begin()
    return lambda: task.wait(PATIENCE_S)


def _go_to(flight: Flight) -> Callable[[], object]:
    return _waited(lambda: flight.uav.go_to_waypoint(flight.offset(30.0), blocking=False))


def _path(flight: Flight) -> Callable[[], object]:
    places = [flight.offset(20.0), flight.offset(20.0, 20.0), flight.offset(0.0)]
    return _waited(lambda: flight.uav.follow_path(places, blocking=False))


def _velocity(flight: Flight) -> Callable[[], object]:
    def stream() -> None:
        while True:
            flight.uav.set_velocity(Twist(Vector3(1.0, 0.0, 0.0)))
            time.sleep(0.05)  # the rate of the stream

    return stream


def _mission(flight: Flight) -> Callable[[], object]:
    point = flight.uav.telemetry().position_geo
    assert point is not None
    north_deg = 3e-4  # 33 m
    items = [Waypoint(point.latitude_deg + each * north_deg, point.longitude_deg, HEIGHT_M) for each in (1, 0)]
    flight.uav.mission.upload(items)
    task = flight.uav.task(flight.uav.mission.start().id)
    return lambda: task.wait(PATIENCE_S)


def _land(flight: Flight) -> Callable[[], object]:
    task = flight.uav.land(blocking=False)
    flight.wait_for(lambda: flight.uav.state() is State.LANDING, "its landing")
    return lambda: task.wait(PATIENCE_S)


FLOWN: dict[str, Callable[[Flight], Callable[[], object] | None]] = {
    "hover": _hover,
    "go_to": _go_to,
    "path": _path,
    "velocity": _velocity,
    "mission": _mission,
    "land": _land,
}


@pytest.fixture
def truth(pilot: Transmitter) -> Truth:
    return Truth(pilot)


@pytest.fixture
def daemon(wiretap: Wiretap, start_daemon: StartDaemon) -> DaemonProcess:
    return start_daemon("--url", wiretap.url, "--allow-arming", backend="mavlink")


@pytest.fixture
def lands_in_the_end(pilot: Transmitter) -> Iterator[None]:
    """Disarms it, wherever it lies."""
    yield
    _disarm(pilot)


def _disarm(pilot: Transmitter) -> None:
    until_s = time.monotonic() + PATIENCE_S
    while pilot.is_armed and time.monotonic() < until_s:
        pilot.order(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (0.0, _FORCE))
        time.sleep(0.5)  # until the autopilot tells it


def _take_off(flight: Flight, doing: Doing, what: str) -> None:
    flight.be_armed()
    if what != "take_off":
        flight.uav.take_off(HEIGHT_M)
        return
    task = flight.uav.take_off(HEIGHT_M + 4.0, blocking=False)
    doing.begin(lambda: task.wait(PATIENCE_S))


@pytest.mark.parametrize("is_restarted", [False, True], ids=["", "restarted"])
@pytest.mark.parametrize("what", ["take_off", *FLOWN])
@pytest.mark.usefixtures("lands_in_the_end")
def test_a_fall_is_reported_and_nothing_climbs_when_the_motors_run_again(
    daemon: DaemonProcess,
    start_daemon: StartDaemon,
    wiretap: Wiretap,
    pilot: Transmitter,
    truth: Truth,
    simulator: Simulator,
    what: str,
    *,
    is_restarted: bool,
) -> None:
    doing = Doing()
    with ual.Uav(address=daemon.address) as uav:
        flight = Flight(uav, pilot)
        _take_off(flight, doing, what)
        if what == "take_off":
            flight.wait_for(lambda: truth.height_m > HEIGHT_M - 2.0, "its height")
        elif (flown := FLOWN[what](flight)) is not None:
            doing.begin(flown)
            if what not in ("land", "velocity"):
                flight.wait_for_speed(1.0)
        with stopped_motors(pilot):
            flight.wait_for(lambda: truth.fell_s is not None, "the fall", 5.0)
            assert truth.fell_s is not None
            fell_s = truth.fell_s
            with suppress(AssertionError):
                flight.wait_for(lambda: _is_reported(uav.telemetry()), "that it does not follow", 3.0)
            told_s = time.monotonic() - fell_s
            told = uav.telemetry()
            doing.join()
            print(f"{simulator.autopilot} {what}: told {told_s:.2f} s after its fall: {told.state_reason}")
            print(f"its task ended by {doing.error}")
            assert _is_reported(told)
            assert told_s < TOLD_S
            if what != "hover":
                assert isinstance(doing.error, TaskAbortedError | WrongStateError)
                assert doing.ended_s is not None
                assert doing.ended_s - fell_s < 2.0 * TOLD_S
            with pytest.raises(UalError):
                uav.go_to_waypoint(Pose.at(0.0, 0.0, HEIGHT_M), blocking=False)
            _wait_until(fell_s + LEFT_S)
            if is_restarted:
                daemon.signal(signal.SIGKILL)
                daemon.wait()
            _wait_until(fell_s + STOPPED_S)
        ran_s = time.monotonic()
    if is_restarted:
        daemon = start_daemon("--url", wiretap.url, "--allow-arming", backend="mavlink")
    heights_m, states = _watched(daemon, truth)
    print(f"{WATCHED_S:.0f} s after the motors ran again at most {max(heights_m):.2f} m up: {states}")
    assert max(heights_m) < STAYS_M, states
    assert [each for each in wiretap.orders(ran_s) if "arm" in str(each)] == []


def _is_reported(told: Telemetry) -> bool:
    """Returns whether the fall is told, or that nothing is known: PX4 may lose its position in a fall."""
    reason = told.state_reason
    return told.state is State.UNINITIALIZED or NOT_FOLLOWED in reason or "in the air, and the UAV f" in reason


def _wait_until(time_s: float) -> None:
    # What must not move meanwhile shows only in time.
    time.sleep(max(0.0, time_s - time.monotonic()))


def _watched(daemon: DaemonProcess, truth: Truth) -> tuple[Sequence[float], Sequence[str]]:
    """Returns its heights, and each state that is told, with its reason, for some seconds."""
    heights_m: list[float] = []
    states: list[str] = []
    until_s = time.monotonic() + WATCHED_S
    with ual.Uav(address=daemon.address) as uav:
        while time.monotonic() < until_s:
            heights_m.append(truth.height_m)
            told = uav.telemetry()
            text = f"{told.state.name}: {told.state_reason}"
            if not states or states[-1] != text:
                states.append(text)
            time.sleep(0.1)  # between two looks
    return heights_m, states


@pytest.mark.usefixtures("lands_in_the_end")
def test_a_mission_that_another_station_replaces_ends_within_a_second(
    daemon: DaemonProcess, pilot: Transmitter
) -> None:
    doing = Doing()
    with ual.Uav(address=daemon.address) as uav:
        flight = Flight(uav, pilot)
        _take_off(flight, doing, "mission")
        doing.begin(_mission(flight))
        flight.wait_for_speed(1.0)
        point = uav.telemetry().position_geo
        assert point is not None
        place = (point.latitude_deg + 4e-4, point.longitude_deg, HEIGHT_M)
        assert pilot.upload_mission([place, place, place])
        replaced_s = time.monotonic()
        doing.join()
        assert doing.ended_s is not None
        print(f"{pilot.autopilot}: {doing.ended_s - replaced_s:.2f} s after the upload: {doing.error}")
        assert isinstance(doing.error, TaskAbortedError)
        assert "mission" in str(doing.error)
        assert doing.ended_s - replaced_s < TOLD_S
        uav.recover_from_manual()
        uav.land()


@pytest.mark.usefixtures("lands_in_the_end")
def test_a_landing_that_is_a_fall_does_not_succeed(daemon: DaemonProcess, pilot: Transmitter, truth: Truth) -> None:
    doing = Doing()
    with ual.Uav(address=daemon.address) as uav:
        flight = Flight(uav, pilot)
        _take_off(flight, doing, "land")
        doing.begin(_land(flight))
        flight.wait_for(lambda: truth.height_m < DISARMED_AT_M, "its descent")
        pilot.order(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (0.0, _FORCE))
        doing.join()
        print(f"{pilot.autopilot}: {doing.error}; {uav.telemetry().state_reason}")
        assert isinstance(doing.error, TaskAbortedError)
        assert doing.error.metadata["by"] == "disarmed in the air"
        with pytest.raises(WrongStateError, match="disarmed in the air"):
            uav.arm()
        flight.wait_for(lambda: "once it lies" not in uav.telemetry().state_reason, "that it lies", 5.0)
        assert uav.state() is State.LANDED_DISARMED
