"""The pilot of `ual teleop` with UAVs that only note what they are asked, and its screen."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable

import pytest

from ual.geometry import Pose, PoseStamped, Twist, TwistStamped, Vector3
from ual.interface import Uav
from ual.types import Battery, Info, Setpoint, State, TaskInfo, TaskKind, TaskStatus, Telemetry
from ual_tools.teleop import board
from ual_tools.teleop.actions import Action
from ual_tools.teleop.keyboard import Keyboard
from ual_tools.teleop.pilot import BRAKING_TIME_S, TELEMETRY_AGE_LIMIT_S, Pilot, StickMode
from ual_tools.teleop.sticks import CENTRED, Sticks
from ual_tools.teleop.vehicle import ScreenMessage, TeleopVehicle

PERIOD_S = 0.05
FORWARD = Sticks(forward=1.0)


class FakeVehicle(TeleopVehicle):
    """Notes what it is asked; it has telemetry at once."""

    def __init__(self, name: str, clock: Callable[[], float]) -> None:
        self.sent: list[Setpoint] = []
        self.commands: list[str] = []
        self.is_refusing = False
        self.fresh_s = 0.0
        super().__init__(None, name, clock)  # type: ignore[arg-type]  # never asked
        self.info = Info(name, "light")
        self.telemetry = Telemetry(State.FLYING_AUTO, pose=Pose.at(0.0, 0.0, 2.0, math.pi / 2), frame_id=f"{name}/odom")

    def age_s(self) -> float:
        return self._clock() - self.fresh_s

    def send(self, setpoint: Setpoint) -> None:
        self.sent.append(setpoint)

    def was_refused(self) -> bool:
        was_refusing, self.is_refusing = self.is_refusing, False
        return was_refusing

    def command(self, name: str, call: Callable[[Uav], object], *, begins: str = "") -> threading.Thread:
        del call, begins
        self.commands.append(name)
        done = threading.Thread(target=lambda: None)
        done.start()
        return done


class Flight:
    """A pilot of some UAVs, with a clock of its own."""

    def __init__(self, count: int = 1) -> None:
        self.now_s = 100.0
        self.vehicles = [FakeVehicle(f"uav_{number + 1}", lambda: self.now_s) for number in range(count)]
        self.pilot = Pilot(self.vehicles, 2.0, lambda: self.now_s)
        self._refresh()

    @property
    def sent(self) -> list[Setpoint]:
        return self.vehicles[0].sent

    def steer(self, sticks: Sticks, duration_s: float = PERIOD_S, *, is_fresh: bool = True) -> None:
        for _ in range(round(duration_s / PERIOD_S)):
            self.now_s += PERIOD_S
            if is_fresh:
                self._refresh()
            self.pilot.steer(sticks)

    def twists(self) -> list[Twist]:
        return [each.twist for each in self.sent if isinstance(each, TwistStamped)]

    def poses(self) -> list[PoseStamped]:
        return [each for each in self.sent if isinstance(each, PoseStamped)]

    def _refresh(self) -> None:
        for vehicle in self.vehicles:
            vehicle.fresh_s = self.now_s


def test_an_idle_pilot_sends_nothing_at_all() -> None:
    flight = Flight()
    flight.steer(CENTRED, 5.0)
    for action in (Action.FASTER, Action.SLOWER, Action.HEADLESS, Action.MODE, Action.NEXT_UAV, Action.QUIT):
        flight.pilot.act(action)
        flight.steer(CENTRED, 1.0)
    assert flight.pilot.stop() == ""
    assert (flight.sent, flight.vehicles[0].commands) == ([], [])


def test_a_release_sends_zero_for_a_moment_and_then_nothing() -> None:
    flight = Flight()
    flight.steer(FORWARD, 1.0)
    assert len(flight.sent) == 20
    assert set(flight.twists()) == {Twist(Vector3(0.5, 0.0, 0.0))}
    assert isinstance(flight.sent[0], TwistStamped)
    assert flight.sent[0].frame_id == "uav_1/base_link"
    flight.sent.clear()
    flight.steer(CENTRED, 3.0)
    assert set(flight.twists()) == {Twist()}
    assert 1 <= len(flight.sent) <= BRAKING_TIME_S / PERIOD_S + 1


def test_headless_is_along_east_and_north() -> None:
    flight = Flight()
    flight.pilot.act(Action.HEADLESS)
    flight.steer(CENTRED)
    flight.steer(Sticks(forward=1.0, up=1.0))
    flight.steer(Sticks(left=-1.0))
    assert [twist.linear for twist in flight.twists()] == [Vector3(0.0, 0.5, 0.5), Vector3(0.5, 0.0, 0.0)]
    assert all(each.frame_id == "" for each in flight.sent)


@pytest.mark.parametrize("action", [Action.STOP, Action.ABORT, Action.LAND, Action.HEADLESS])
def test_a_stick_that_is_held_does_nothing_after_an_action_until_it_is_released(action: Action) -> None:
    flight = Flight()
    flight.steer(FORWARD, 1.0)
    flight.pilot.act(action)
    flight.sent.clear()
    flight.steer(FORWARD, 1.0)
    assert set(flight.twists()) <= {Twist()}
    flight.steer(CENTRED)
    flight.steer(FORWARD)
    assert flight.twists()[-1] != Twist()


def test_after_a_stop_no_velocity_follows_it() -> None:
    flight = Flight()
    flight.steer(FORWARD, 1.0)
    flight.sent.clear()
    flight.pilot.act(Action.STOP)
    flight.steer(FORWARD, 1.0)
    assert flight.vehicles[0].commands == ["stop"]
    assert flight.sent == []


def test_after_a_refusal_nothing_is_sent_until_the_release() -> None:
    flight = Flight()
    flight.steer(FORWARD, 1.0)
    flight.vehicles[0].is_refusing = True
    flight.steer(FORWARD)
    flight.sent.clear()
    flight.steer(FORWARD, 2.0)
    assert flight.sent == []
    flight.steer(CENTRED)
    flight.steer(FORWARD)
    assert len(flight.sent) == 1


def test_a_refusal_that_comes_after_the_release_does_not_hinder_the_next_touch() -> None:
    flight = Flight()
    flight.steer(FORWARD, 1.0)
    flight.vehicles[0].is_refusing = True
    flight.steer(CENTRED)
    flight.sent.clear()
    flight.steer(FORWARD)
    assert len(flight.sent) == 1


def test_before_the_first_telemetry_the_sticks_do_nothing() -> None:
    flight = Flight()
    flight.vehicles[0].telemetry = None
    flight.steer(FORWARD, 1.0)
    flight.pilot.act(Action.MODE)
    flight.pilot.step(FORWARD)
    assert flight.sent == []


def test_old_telemetry_releases_the_sticks() -> None:
    flight = Flight()
    flight.steer(FORWARD, 1.0)
    flight.steer(FORWARD, TELEMETRY_AGE_LIMIT_S + 2 * PERIOD_S, is_fresh=False)
    assert flight.twists()[-1] == Twist()
    assert "no telemetry" in flight.pilot.view().refusal.text
    flight.sent.clear()
    flight.steer(FORWARD, 3.0)  # it is back, but the stick was not released
    assert set(flight.twists()) <= {Twist()}


def test_the_end_stops_what_the_sticks_fly_and_nothing_else() -> None:
    flight = Flight()
    flight.steer(FORWARD, 1.0)
    assert flight.pilot.stop() == "uav_1 stops and holds its position"
    assert flight.vehicles[0].commands == ["stop"]
    flight.steer(CENTRED, 3.0)
    assert flight.pilot.stop() == ""


def test_a_change_of_the_uav_stops_the_one_that_is_left_and_only_if_it_flies_by_the_sticks() -> None:
    flight = Flight(2)
    flight.pilot.act(Action.NEXT_UAV)
    flight.pilot.act(Action.PREVIOUS_UAV)
    assert [vehicle.commands for vehicle in flight.vehicles] == [[], []]
    flight.steer(CENTRED)
    flight.steer(FORWARD, 1.0)
    flight.pilot.act(Action.NEXT_UAV)
    assert [vehicle.commands for vehicle in flight.vehicles] == [["stop"], []]
    flight.steer(FORWARD, 1.0)
    assert flight.vehicles[1].sent == []
    flight.steer(CENTRED)
    flight.steer(FORWARD)
    assert len(flight.vehicles[1].sent) == 1


# --- The pose mode ----------------------------------------------------------------------------------------------------


@pytest.fixture
def posing() -> Flight:
    flight = Flight()
    flight.pilot.act(Action.MODE)
    return flight


def test_steps_lead_along_the_nose_and_add_up(posing: Flight) -> None:
    for direction in (FORWARD, FORWARD, Sticks(turn=-1.0), Sticks(up=1.0)):
        posing.pilot.step(direction)
    last = posing.poses()[-1]
    assert tuple(last.pose.position) == pytest.approx((0.0, 0.5, 2.25))  # the nose is to the north
    assert math.degrees(last.pose.yaw_rad) == pytest.approx(80.0)
    assert last.frame_id == "uav_1/odom"


def test_a_reference_that_another_has_replaced_is_not_gone_on_from(posing: Flight) -> None:
    vehicle = posing.vehicles[0]
    posing.pilot.step(FORWARD)
    posing.now_s = vehicle.fresh_s = posing.now_s + 10.0
    vehicle.telemetry = Telemetry(State.FLYING_AUTO, pose=Pose.at(5.0, 5.0, 5.0, 0.0), reference_pose=Pose.at(9, 5, 5))
    posing.pilot.step(FORWARD)
    assert tuple(posing.poses()[-1].pose.position) == pytest.approx((5.25, 5.0, 5.0))


def test_the_reference_waits_for_the_uav(posing: Flight) -> None:
    for _ in range(40):
        posing.pilot.step(FORWARD)
    assert posing.poses()[-1].pose.position.y == pytest.approx(3.25)
    assert "behind" in posing.pilot.view().refusal.text


def test_a_stick_that_is_held_makes_steps(posing: Flight) -> None:
    posing.steer(CENTRED)
    posing.steer(FORWARD, 1.7)
    assert len(posing.poses()) == 4
    assert posing.twists() == []


def test_the_end_stops_a_step_that_is_being_executed(posing: Flight) -> None:
    posing.pilot.step(FORWARD)
    assert posing.pilot.stop() == "uav_1 stops and holds its position"
    posing.now_s += 10.0
    assert posing.pilot.stop() == ""


# --- Keys and screen --------------------------------------------------------------------------------------------------


def test_keys_that_waited_can_only_end_a_motion() -> None:
    flight, keys = Flight(), Keyboard()
    keys.control(flight.pilot, b"t\r\x1b[A\x1b[Ap", flight.now_s, is_late=True)
    assert (flight.sent, flight.vehicles[0].commands, flight.pilot.mode) == ([], [], StickMode.VELOCITY)
    keys.control(flight.pilot, b"ww l", flight.now_s, is_late=True)
    assert flight.vehicles[0].commands == ["stop", "land"]


@pytest.mark.parametrize(("width", "height"), [(80, 24), (60, 20), (60, 16), (40, 24), (100, 40), (20, 5)])
def test_the_screen_fits(width: int, height: int) -> None:
    flight = Flight(3)
    vehicle = flight.vehicles[0]
    vehicle.telemetry = Telemetry(
        State.FLYING_MANUAL,
        state_reason="the safety pilot flies it, " * 6,
        pose=Pose.at(-1234.56, 2345.67, 119.9, 3.1),
        frame_id="a_long_name_of_a_uav_12/odom",
        velocity=Twist(Vector3(3.0, 4.0, -1.0)),
        battery=Battery(87.4, 15.2),
        flight_mode="AUTO_LOITER",
        armed=True,
        task=TaskInfo("1", TaskKind.GO_TO_WAYPOINT, TaskStatus.RUNNING, description="goes to 4 2 3 " * 10),
    )
    vehicle.refusal = ScreenMessage("sticks: WRONG_STATE: set_velocity needs the state FLYING_AUTO, " * 5, flight.now_s)
    vehicle.done = ScreenMessage("landing", flight.now_s)
    keys = Keyboard()
    shown = board.screen_rows(
        flight.pilot.view(), keys.title, keys.help, "take-off? Enter confirms", width=width, height=height
    )
    assert len(shown) <= height
    assert max(len(line.text) for line in shown) <= width
    text = "\n".join(line.text for line in shown)
    if width >= 40:  # all keys are told on a small screen, too
        for keys_text, what in keys.help:
            assert " ".join(keys_text.split()) in " ".join(text.split())
            assert what in " ".join(text.split())
    if (width, height) == (80, 24):
        known = (
            "uav_1 (1 of 3, Tab)",
            "FLYING_MANUAL",
            "87 %",
            "level 2 of 5",
            "Enter confirms",
            "WRONG_STATE",
            "quit",
        )
        for each in known:
            assert each in text
