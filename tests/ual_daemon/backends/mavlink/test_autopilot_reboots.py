"""Frames stay true when an autopilot boots elsewhere, moves its local origin, or resets its estimate.

Simulated autopilots, on one clock with the backend.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.simulators import ArduPilot, Autopilot, BadLink, MemoryPort, Px4
from tests.simulators.physics import Vector
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import UsualRates
from tests.waiting import LIMIT_S
from ual.errors import FrameLostError, GeofenceError, TaskAbortedError, WrongStateError
from ual.geometry import IDENTITY, Pose, PoseStamped, Transform, Twist, TwistStamped, Vector3, wrap_angle
from ual.types import GeoPoint, State
from ual_daemon.frames.home_file import HomeFile
from ual_daemon.settings import GeofenceSettings, VehicleSettings

EAST_10: Vector = (0.0, 10.0, 0.0)
EAST_20: Vector = (0.0, 20.0, 0.0)
RESET_RAD = math.radians(30.0)


class Placed(UsualRates):
    """A simulated autopilot that stands on the ground somewhere in its local frame."""

    def __init__(
        self,
        kind: str,
        start: Vector,
        settings: VehicleSettings | None = None,
        *,
        has_satellites: bool = True,
        home_file: Path | None = None,
    ) -> None:
        self.port = MemoryPort()
        self.link = BadLink(self.port, 0)
        autopilot: Autopilot
        is_px4 = kind == "px4"
        autopilot = (
            Px4(self.link, start=start, is_terse=True) if is_px4 else ArduPilot(self.link, start=start, settle_s=4.0)
        )
        autopilot.has_satellites = has_satellites
        if not has_satellites:
            autopilot.home = None
        self.autopilot = autopilot
        self.settings, self.home_file = settings, home_file
        self.start()

    def restart(self) -> None:
        """Kills the daemon, and starts another."""
        self.kill()
        self.start()
        self.wait_for_state(State.LANDED_DISARMED, State.FLYING_AUTO)
        self.let_pass(2.0)

    def reboot(self, carried: Vector = (0.0, 0.0, 0.0), gps_error: Vector = (0.0, 0.0, 0.0)) -> None:
        """Swaps the battery, and waits until the UAV is ready again."""
        count = self.backend.link_statistics().reboots_count
        self.autopilot.reboot(carried, gps_error)
        self.wait_for(lambda: self.backend.link_statistics().reboots_count > count, "the reboot")
        self.let_pass(1.0)
        self.wait_for_state(State.LANDED_DISARMED)

    def position(self) -> Vector3:
        """The reported position."""
        return self.uav.pose().pose.position

    def is_placed(self) -> bool:
        """Returns whether a pose is reported."""
        return self.uav.telemetry().pose is not None

    def current_position(self) -> Vector3:
        """Returns the true position of the UAV, from the autopilot's first origin: east, north, up."""
        north, east, down = self.autopilot.current_position
        return Vector3(east, north, -down)


Start = Callable[..., Placed]


@pytest.fixture
def start(kind: str) -> Iterator[Start]:
    started: list[Placed] = []

    def begin(
        start: Vector = (0.0, 0.0, 0.0), settings: VehicleSettings | None = None, home_file: Path | None = None
    ) -> Placed:
        flight = Placed(kind, start, settings, home_file=home_file)
        started.append(flight)
        flight.wait_for_state(State.LANDED_DISARMED)
        flight.wait_for(flight.is_placed, "its pose")
        flight.let_pass(2.0)  # until its origin has come
        return flight

    yield begin
    for each in started:
        each.uav.close()


@pytest.fixture(params=["px4", "ardupilot"])
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def _farthest_m(flight: Placed, start: Vector3, duration_s: float) -> float:
    """Lets time pass, and returns how far the UAV really was from a place in it."""
    until_s, farthest_m = flight.now_s + duration_s, 0.0
    while flight.now_s < until_s:
        farthest_m = max(farthest_m, (flight.current_position() - start).norm())
        flight.let_pass(0.05)
    return farthest_m


def near(x: float, y: float, z: float, abs_m: float = 0.1) -> object:
    return pytest.approx((x, y, z), abs=abs_m)


# --- A reboot ---------------------------------------------------------------------------------------------------------


def test_home_stays_where_it_was_set_when_the_battery_is_swapped_on_the_spot(start: Start) -> None:
    flight = start(EAST_10)
    flight.uav.set_home()
    assert tuple(flight.position()) == near(0, 0, 0)
    flight.reboot()
    flight.wait_for(flight.is_placed, "its pose")
    assert tuple(flight.position()) == near(0, 0, 0)  # it said -10 m
    flight.take_off()
    flight.uav.go_to_waypoint(Pose.at(0.0, 0.0, 5.0))
    assert tuple(flight.current_position()) == near(10, 0, 5, 0.5)
    flight.land()


def test_a_uav_that_was_carried_while_it_was_off_flies_back_to_its_home(start: Start) -> None:
    flight = start()
    flight.uav.set_home()
    flight.reboot(EAST_20)
    flight.wait_for(flight.is_placed, "its pose")
    assert tuple(flight.position()) == near(20, 0, 0)
    flight.take_off()
    flight.uav.go_to_waypoint(Pose.at(0.0, 0.0, 3.0))
    assert tuple(flight.current_position()) == near(0, 0, 3, 0.5)


def test_home_is_as_exact_as_the_satellites(start: Start) -> None:
    flight = start()
    flight.uav.set_home()
    flight.reboot(gps_error=(-1.0, 1.5, 0.5))
    flight.wait_for(flight.is_placed, "its pose")
    assert tuple(flight.position()) == near(1.5, -1.0, -0.5)


def test_map_stays_where_it_is_on_earth(start: Start) -> None:
    origin = (47.3977428, 8.5455967, 489.0)
    flight = start(settings=VehicleSettings(map_origin_geo=origin, pose_frame_id="map"))
    here = flight.position()
    flight.reboot(EAST_20)
    flight.wait_for(flight.is_placed, "its pose")
    assert tuple(flight.position() - here) == near(20, 0, 0)
    flight.take_off()
    flight.uav.go_to_waypoint(PoseStamped(Pose.at(here.x, here.y, here.z + 3.0), "map"))
    assert tuple(flight.current_position()) == near(0, 0, 3, 0.5)


SQUARE = ((-15.0, -15.0), (15.0, -15.0), (15.0, 15.0), (-15.0, 15.0))


@pytest.mark.parametrize("has_origin", [False, True])
def test_a_fence_in_map_stays_where_it_is(start: Start, *, has_origin: bool) -> None:
    origin = (47.3977424, 8.5455954, 489.0) if has_origin else None
    settings = VehicleSettings(geofence=GeofenceSettings(frame_id="map", polygon=SQUARE), map_origin_geo=origin)
    flight = start(settings=settings)
    flight.reboot(EAST_20)
    flight.wait_for(flight.is_placed, "its pose")
    assert flight.autopilot.pilot_arm()
    flight.wait_for_state(State.LANDED_ARMED)
    with pytest.raises(GeofenceError):
        flight.uav.take_off(3.0)
    assert not flight.autopilot.setpoints_s


def test_frames_that_hang_on_odom_and_map_follow(start: Start) -> None:
    flight = start()
    flight.uav.add_frame(_frame("pad", flight.uav.vehicle.ns + "/odom"))
    flight.uav.add_frame(_frame("field", "map"))
    flight.reboot(EAST_20)
    flight.wait_for(flight.is_placed, "its pose")
    for frame_id in ("pad", "field"):
        assert tuple(flight.uav.transform(frame_id).translation) == near(18, 0, 0)
    flight.take_off()
    flight.uav.go_to_waypoint(PoseStamped(Pose.at(0.0, 0.0, 3.0), "pad"))
    assert tuple(flight.current_position()) == near(2, 0, 3, 0.5)


def _frame(name: str, parent: str) -> Transform:
    return Transform(Vector3(2.0, 0.0, 0.0), IDENTITY, parent, name)


# --- Nothing ties the frames to Earth ---------------------------------------------------------------------------------


@pytest.fixture
def lost() -> Iterator[Placed]:
    """A PX4 indoors that was carried and booted anew."""
    flight = Placed("px4", (0.0, 0.0, 0.0), has_satellites=False)
    flight.wait_for_state(State.LANDED_DISARMED)
    flight.reboot(EAST_20)
    yield flight
    flight.uav.close()


def test_without_satellites_the_frames_are_lost_and_say_so(lost: Placed) -> None:
    telemetry = lost.uav.telemetry()
    assert telemetry.state is State.LANDED_DISARMED
    assert (telemetry.pose, telemetry.odometry, telemetry.transform) == (None, None, None)
    assert "rebooted" in telemetry.frame_lost
    with pytest.raises(FrameLostError, match="set_home"):
        lost.uav.pose()
    with pytest.raises(FrameLostError):
        lost.uav.transform()


def test_in_a_lost_frame_nothing_moves_but_it_can_fly_by_its_body_and_land(lost: Placed) -> None:
    lost.take_off()
    for motion in (Pose.at(0.0, 0.0, 3.0), PoseStamped(Pose.at(0.0, 0.0, 3.0), "map")):
        with pytest.raises(FrameLostError) as caught:
            lost.uav.go_to_waypoint(motion)
        assert caught.value.metadata["since"].endswith("Z")
        assert "set_home" in caught.value.metadata["remedy"]
        with pytest.raises(FrameLostError):
            lost.uav.set_pose(motion)
    with pytest.raises(FrameLostError):
        lost.uav.set_velocity(Twist(Vector3(1.0, 0.0, 0.0)))
    began_s = lost.now_s
    while lost.now_s < began_s + 2.0:
        lost.uav.set_velocity(TwistStamped(Twist(Vector3(1.0, 0.0, 0.0)), "uav_1/base_link"))
        lost.let_pass(0.1)
    lost.uav.abort()
    lost.let_pass(3.0)
    assert lost.current_position().horizontal_norm() > 1.0
    here = lost.current_position()
    lost.uav.go_to_waypoint(PoseStamped(Pose.at(2.0, 0.0, 0.0), "uav_1/base_link"))
    assert (lost.current_position() - here).norm() == pytest.approx(2.0, abs=0.5)
    lost.autopilot.pilot_take_over()
    lost.wait_for_state(State.FLYING_MANUAL)
    lost.uav.recover_from_manual()
    lost.land()


def test_set_home_makes_a_lost_frame_known_again(lost: Placed) -> None:
    lost.uav.set_home()
    assert lost.uav.telemetry().frame_lost == ""
    assert tuple(lost.position()) == near(0, 0, 0)
    lost.take_off()
    lost.uav.go_to_waypoint(Pose.at(0.0, 0.0, 3.0))
    assert tuple(lost.current_position()) == near(20, 0, 3, 0.5)


def test_a_fence_in_a_lost_frame_refuses_the_take_off() -> None:
    settings = VehicleSettings(geofence=GeofenceSettings(frame_id="map", polygon=SQUARE))
    flight = Placed("px4", (0.0, 0.0, 0.0), settings, has_satellites=False)
    try:
        flight.wait_for_state(State.LANDED_DISARMED)
        flight.reboot()
        assert flight.autopilot.pilot_arm()
        flight.wait_for_state(State.LANDED_ARMED)
        with pytest.raises(FrameLostError):
            flight.uav.take_off(3.0)
        flight.uav.set_home()
        flight.uav.take_off(3.0)
        with pytest.raises(GeofenceError):
            flight.uav.go_to_waypoint(Pose.at(20.0, 0.0, 3.0))
        flight.land()
    finally:
        flight.uav.close()


# --- A restart of the daemon ------------------------------------------------------------------------------------------


@pytest.fixture
def home_file(tmp_path: Path) -> Path:
    return tmp_path / "uav_1.home"


def test_home_survives_a_restart_of_the_daemon_and_the_same_go_to_leads_there(start: Start, home_file: Path) -> None:
    flight = start(EAST_10, home_file=home_file)
    flight.uav.set_home()
    flight.restart()
    assert tuple(flight.position()) == near(0, 0, 0)
    flight.take_off()
    flight.uav.go_to_waypoint(Pose.at(0.0, 0.0, 4.0))
    assert tuple(flight.current_position()) == near(10, 0, 4, 0.5)


def test_home_survives_when_both_are_off_and_the_uav_is_carried(start: Start, home_file: Path) -> None:
    flight = start(home_file=home_file)
    flight.uav.set_home()
    flight.kill()
    flight.autopilot.reboot(EAST_20)
    flight.autopilot.run(3.0)
    flight.start()
    flight.wait_for_state(State.LANDED_DISARMED)
    flight.wait_for(flight.is_placed, "its pose")
    assert tuple(flight.position()) == near(20, 0, 0)


def test_a_home_that_followed_a_reboot_is_saved_with_the_position_of_the_fence(start: Start, home_file: Path) -> None:
    settings = VehicleSettings(geofence=GeofenceSettings(frame_id="map", polygon=SQUARE))
    flight = start(settings=settings, home_file=home_file)
    flight.reboot(EAST_20)
    flight.wait_for(flight.is_placed, "its pose")
    flight.wait_for(home_file.exists, "the file")  # which is not written on the thread that flies
    flight.restart()
    assert tuple(flight.position()) == near(20, 0, 0)
    assert flight.autopilot.pilot_arm()
    flight.wait_for_state(State.LANDED_ARMED)
    with pytest.raises(GeofenceError):
        flight.uav.take_off(3.0)


def test_in_flight_home_is_there_again_within_two_seconds_of_a_restart(start: Start, home_file: Path) -> None:
    flight = start(EAST_10, home_file=home_file)
    flight.uav.set_home()
    flight.take_off()
    flight.kill()
    flight.start()
    flight.wait_for(flight.is_placed, "its pose")
    assert flight.now_s - flight.started_s < 2.5
    assert tuple(flight.position()) == near(0, 0, 3, 0.5)


def _changed(file: Path, **values: object) -> None:
    file.write_text(json.dumps({**json.loads(file.read_text()), **values}))


@pytest.mark.parametrize(
    "changes",
    [{"vehicle": "PX4 7 ab"}, {"saved_s": 1e9}, {"home": {"latitude_deg": 1e9}}, {"saved_s": "?"}],
    ids=["another vehicle", "old", "not on Earth", "damaged"],
)
def test_what_does_not_hold_any_more_is_ignored_and_logged(
    start: Start, home_file: Path, changes: dict[str, object], caplog: pytest.LogCaptureFixture
) -> None:
    flight = start(EAST_10, home_file=home_file)
    flight.uav.set_home()
    flight.kill()
    _changed(home_file, **changes)
    flight.restart()
    assert tuple(flight.position()) == near(10, 0, 0)
    assert {"home_ignored", "home_file_ignored"} & {vars(record).get("ual_event") for record in caplog.records}


def test_a_home_far_away_is_lost_on_the_ground(start: Start, home_file: Path) -> None:
    flight = start(EAST_10, home_file=home_file)
    flight.uav.set_home()
    flight.kill()
    elsewhere = {"latitude_deg": 48.0, "longitude_deg": 8.5, "altitude_amsl_m": 400.0}
    _changed(home_file, home=elsewhere)
    flight.restart()
    assert "km from here" in flight.uav.telemetry().frame_lost
    flight.uav.set_home()
    assert tuple(flight.position()) == near(0, 0, 0)


def test_a_home_without_satellites_is_lost_by_a_restart(lost: Placed, home_file: Path) -> None:
    lost.home_file = home_file
    lost.restart()  # begins without a file: nothing was set, nothing is lost
    assert lost.uav.telemetry().frame_lost == ""
    lost.uav.set_home()
    lost.restart()
    assert "nothing tied it to Earth" in lost.uav.telemetry().frame_lost
    lost.uav.set_home()
    assert tuple(lost.position()) == near(0, 0, 0)


def test_an_older_home_does_not_replace_a_newer_one_however_late_it_is_written(tmp_path: Path) -> None:
    file = HomeFile(tmp_path / "uav_1.home")
    newer = GeoPoint(47.0, 8.0, 400.0)
    file.write("PX4 1 ab", newer, None, 2)
    file.write("PX4 1 ab", GeoPoint(46.0, 7.0, 300.0), None, 1)
    saved = file.read()
    assert saved is not None
    assert saved.home == newer


def test_the_file_of_another_user_or_a_link_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "uav_1.home"
    HomeFile(path).write("PX4 1 ab", GeoPoint(47.0, 8.0, 400.0), None, 1)
    saved = HomeFile(path).read()
    assert saved is not None
    assert saved.home == GeoPoint(47.0, 8.0, 400.0)
    link = tmp_path / "link.home"
    link.symlink_to(path)
    assert HomeFile(link).read() is None
    monkeypatch.setattr("os.geteuid", lambda: 12345)
    assert HomeFile(path).read() is None


def test_a_directory_that_cannot_be_written_is_logged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    HomeFile(tmp_path / "missing" / "uav_1.home").write("PX4 1 ab", None, None, 1)
    assert [vars(record).get("ual_event") for record in caplog.records] == ["not_saved"]


# --- In flight --------------------------------------------------------------------------------------------------------


def test_a_held_position_does_not_jump_when_the_origin_moves(start: Start) -> None:
    flight = start()
    flight.take_off()
    flight.let_pass(2.0)
    before = flight.current_position()
    flight.autopilot.move_origin((-8.0, 30.0, 2.0))
    farthest_m = _farthest_m(flight, before, 5.0)
    assert farthest_m < 0.3
    flight.wait_for(flight.is_placed, "its pose")
    assert tuple(flight.position()) == near(0, 0, 3, 0.5)  # the frames have followed
    flight.uav.go_to_waypoint(Pose.at(4.0, 0.0, 3.0))
    assert tuple(flight.current_position() - before) == near(4, 0, 0, 0.5)
    flight.land()


def test_a_held_position_does_not_jump_when_the_estimate_is_reset(start: Start) -> None:
    flight = start()
    flight.take_off()
    flight.let_pass(2.0)
    before = flight.current_position()
    flight.autopilot.jump((6.0, -4.0, 1.5))
    assert _farthest_m(flight, before, 5.0) < 0.3
    assert tuple(flight.position()) == near(-4, 6, 1.5, 0.5)  # the estimate is believed


@pytest.mark.parametrize("how", ["origin", "estimate"])
def test_a_go_to_ends_when_the_estimate_jumps_and_the_uav_holds(start: Start, how: str) -> None:
    flight = start()
    flight.take_off()
    task = flight.uav.go_to_waypoint(flight.goal(40.0, 0.0), blocking=False)
    flight.wait_for(lambda: flight.uav.velocity().twist.linear.norm() > 1.5, "its speed")
    before = flight.current_position()
    act = flight.autopilot.move_origin if how == "origin" else flight.autopilot.jump
    act((5.0, 3.0, 0.0))
    with pytest.raises(TaskAbortedError, match="jumped") as caught:
        task.wait(LIMIT_S)
    assert caught.value.metadata["by"] == "estimator"
    flight.let_pass(8.0)
    assert abs((flight.current_position() - before).y) < 0.5
    assert 0.0 < (flight.current_position() - before).x < 15.0
    assert flight.uav.state() is State.FLYING_AUTO
    assert flight.uav.velocity().twist.linear.norm() < 0.2
    flight.land()


def test_a_take_off_goes_on_by_as_much_above_the_ground_when_the_estimate_jumps(start: Start) -> None:
    flight = start()
    assert flight.autopilot.pilot_arm()
    flight.wait_for_state(State.LANDED_ARMED)
    flight.wait_for(flight._is_take_off_planned, "what a take-off needs")
    task = flight.uav.take_off(4.0, blocking=False)
    flight.wait_for(lambda: flight.current_position().z > 1.0, "its climb")
    flight.autopilot.jump((3.0, 2.0, -2.5))
    task.wait(LIMIT_S)
    assert tuple(flight.current_position()) == near(0, 0, 4, 0.6)
    flight.land()


def test_the_floor_and_the_ceiling_stay_at_the_ground_when_the_estimate_jumps(start: Start) -> None:
    flight = start()
    flight.take_off()
    flight.autopilot.jump((0.0, 0.0, -10.0))
    flight.let_pass(2.0)
    with pytest.raises(GeofenceError, match="below the floor"):
        flight.uav.go_to_waypoint(Pose.at(0.0, 0.0, 8.0))
    flight.land()


def test_small_jumps_are_executed_out(start: Start) -> None:
    flight = start()
    flight.take_off()
    task = flight.uav.go_to_waypoint(flight.goal(10.0, 0.0), blocking=False)
    flight.wait_for(lambda: flight.uav.velocity().twist.linear.norm() > 1.0, "its speed")
    flight.autopilot.jump((0.4, 0.4, 0.2))
    task.wait(LIMIT_S)


@pytest.mark.parametrize("is_pose_set", [False, True])
def test_a_held_heading_does_not_turn_when_the_estimate_of_the_heading_is_reset(
    start: Start, *, is_pose_set: bool
) -> None:
    flight = start()
    flight.take_off()
    if is_pose_set:
        flight.uav.set_pose(flight.goal(0.0, 0.0))
    flight.let_pass(2.0)
    before, heading_rad = flight.current_position(), flight.autopilot.true_heading_rad
    flight.autopilot.jump_heading(RESET_RAD)
    assert _farthest_turned_rad(flight, heading_rad, 5.0) < 0.1
    assert (flight.current_position() - before).norm() < 0.3
    assert flight.uav.state() is State.FLYING_AUTO


def test_a_go_to_ends_when_the_heading_jumps_and_the_uav_holds_where_it_points(start: Start) -> None:
    flight = start()
    flight.take_off()
    task = flight.uav.go_to_waypoint(flight.goal(40.0, 0.0), blocking=False)
    flight.wait_for(lambda: flight.uav.velocity().twist.linear.norm() > 1.5, "its speed")
    before, heading_rad = flight.current_position(), flight.autopilot.true_heading_rad
    flight.autopilot.jump_heading(-RESET_RAD)
    with pytest.raises(TaskAbortedError, match="heading jumped by 30 deg") as caught:
        task.wait(LIMIT_S)
    assert caught.value.metadata["by"] == "estimator"
    assert _farthest_turned_rad(flight, heading_rad, 6.0) < 0.1
    assert abs((flight.current_position() - before).y) < 0.5
    assert flight.uav.velocity().twist.linear.norm() < 0.2
    flight.uav.go_to_waypoint(flight.goal(-3.0, 0.0))  # by the new heading


def test_a_velocity_goes_on_and_keeps_the_nose_when_the_heading_jumps(start: Start) -> None:
    flight = start()
    flight.take_off()
    before, heading_rad, jumped = flight.current_position(), flight.autopilot.true_heading_rad, False
    until_s, turned_rad = flight.now_s + 5.0, 0.0
    while flight.now_s < until_s:
        flight.uav.set_velocity(Twist(Vector3(1.0, 0.0, 0.0)))
        flight.let_pass(0.1)
        turned_rad = max(turned_rad, abs(wrap_angle(flight.autopilot.true_heading_rad - heading_rad)))
        if not jumped and flight.now_s > until_s - 3.0:
            jumped = True
            flight.autopilot.jump_heading(RESET_RAD)
    assert turned_rad < 0.1
    assert (flight.current_position() - before).x > 2.5
    assert abs((flight.current_position() - before).y) < 0.4


def test_a_take_off_goes_on_without_turning_when_the_heading_jumps(start: Start) -> None:
    """PX4 corrects its heading at 1.5 m, where the ground disturbs its compass no more."""
    flight = start()
    assert flight.autopilot.pilot_arm()
    flight.wait_for_state(State.LANDED_ARMED)
    flight.wait_for(flight._is_take_off_planned, "what a take-off needs")
    heading_rad = flight.autopilot.true_heading_rad
    task = flight.uav.take_off(4.0, blocking=False)
    flight.wait_for(lambda: flight.current_position().z > 1.5, "its climb")
    flight.autopilot.jump_heading(RESET_RAD)
    task.wait(LIMIT_S)
    assert _farthest_turned_rad(flight, heading_rad, 3.0) < 0.1
    assert tuple(flight.current_position()) == near(0, 0, 4, 0.6)
    flight.land()


def _farthest_turned_rad(flight: Placed, from_rad: float, duration_s: float) -> float:
    """Returns the largest true turn of its nose within a time."""
    until_s, farthest_rad = flight.now_s + duration_s, 0.0
    while flight.now_s < until_s:
        flight.let_pass(0.05)
        farthest_rad = max(farthest_rad, abs(wrap_angle(flight.autopilot.true_heading_rad - from_rad)))
    return farthest_rad


def test_a_set_home_in_the_wrong_state_is_still_refused(lost: Placed) -> None:
    lost.take_off()
    with pytest.raises(WrongStateError):
        lost.uav.set_home()


def test_a_battery_that_was_not_measured_yet_after_a_boot_is_no_failsafe(start: Start) -> None:
    flight = start()
    told: list[str] = []
    with flight.uav.subscribe(lambda each: told.append("" if each.health is None else each.health.failsafe)):
        flight.reboot()
    assert not any(told)
