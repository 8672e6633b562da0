"""Poses from outside and simulated autopilots on one clock: they fly on them without GPS, and say when they stop."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import pytest

from tests.simulators import Px4
from tests.simulators.autopilot import Autopilot
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import HEIGHT_M, Flight
from ual.geometry import Pose, PoseStamped, Quaternion, Vector3
from ual.types import Capability, State, Telemetry
from ual_daemon.backends.mavlink.dialects.axes import enu_to_ned_yaw, ned_to_enu

NOISE_M = 0.005
PERIOD_S = 0.02
_NONE = Vector3()
_SET_UP: Mapping[str, Mapping[str, float]] = {
    "px4": {"EKF2_EV_CTRL": 11},
    "ardupilot": {"VISO_TYPE": 1.0, "EK3_SRC1_POSXY": 6.0},
}


class MotionCapture:
    """Gives the UAV its true pose in ``map``, whenever the autopilot's time has passed a period, while it `is_on`."""

    def __init__(self, flight: Flight, offset: Vector3 = _NONE) -> None:
        """`offset` is from where its origin is, to where the autopilot thinks that its own is."""
        self._flight = flight
        self._next_s = 0.0
        self._offset = offset
        self.is_on = True
        flight.uav.vehicle.subscribe(self._on_update)

    def _on_update(self, _: Telemetry) -> None:
        now_s = self._flight.now_s
        if self.is_on and now_s >= self._next_s:
            self._next_s = now_s + PERIOD_S
            there = true_pose(self._flight.autopilot)
            pose = PoseStamped(
                Pose(there.position + self._offset, there.orientation), "map", self._flight.backend.utc_s()
            )
            self._flight.uav.set_external_pose(pose, position_std_dev_m=NOISE_M)


def true_pose(autopilot: Autopilot) -> Pose:
    return Pose(ned_to_enu(*autopilot.current_position), Quaternion.from_yaw(enu_to_ned_yaw(autopilot.body.yaw_rad)))


class OutdoorFlight(Flight):
    """Of an autopilot that is set up for poses from outside."""

    def start(self) -> None:
        self.autopilot.parameters.update(_SET_UP["px4" if isinstance(self.autopilot, Px4) else "ardupilot"])
        super().start()

    def distance_m(self, place: Vector3) -> float:
        """From a place in odom, without the height."""
        return (self.uav.pose().pose.position - place).horizontal_norm()


class IndoorFlight(OutdoorFlight):
    """Without satellites from its boot on."""

    def start(self) -> None:
        self.autopilot.lose_gps()
        self.autopilot.has_satellites = False
        self.autopilot.gps_lost_s = -math.inf
        super().start()


@contextmanager
def started(kind: str, of: type[OutdoorFlight]) -> Iterator[OutdoorFlight]:
    flight = of(kind)
    try:
        yield flight
    finally:
        flight.kill()
        flight.uav.vehicle.close()


@pytest.fixture(params=["px4", "ardupilot"])
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def flight(kind: str) -> Iterator[OutdoorFlight]:
    with started(kind, OutdoorFlight) as flight:
        flight.wait_for(flight.uav.is_ready, "a state")
        yield flight


def test_it_flies_and_lands_on_poses_from_outside_when_gps_is_lost(flight: Flight) -> None:
    uav, autopilot = flight.uav, flight.autopilot
    assert Capability.EXTERNAL_POSE in uav.info().capabilities
    MotionCapture(flight)
    ground = true_pose(autopilot).position
    flight.take_off()
    autopilot.lose_gps()
    flight.let_pass(8.0)  # longer than it flies without a position
    assert uav.state() is State.FLYING_AUTO
    goal = Pose.at(4.0, 3.0, ground.z + HEIGHT_M)
    uav.go_to_waypoint(goal)
    assert (true_pose(autopilot).position - goal.position).norm() < 0.4
    uav.land()
    flight.wait_for_state(State.LANDED_DISARMED)
    assert true_pose(autopilot).position.z == pytest.approx(ground.z, abs=0.05)


def test_a_source_that_stops_is_named_where_the_position_is_lost(flight: Flight) -> None:
    source = MotionCapture(flight)
    flight.autopilot.lose_gps()
    flight.let_pass(8.0)
    assert flight.uav.is_ready()
    source.is_on = False
    flight.wait_for_state(State.UNINITIALIZED)
    reason = flight.uav.telemetry().state_reason
    assert "no good position" in reason
    assert "; no poses from outside for " in reason
    assert float(reason.rpartition("for ")[2].removesuffix(" s")) > 2.0
    source.is_on = True
    flight.wait_for_state(State.LANDED_DISARMED)


def test_without_satellites_poses_in_map_lay_its_local_frame_and_home_does_not_move_them(kind: str) -> None:
    with started(kind, IndoorFlight) as flight:
        flight.wait_for(lambda: bool(flight.uav.info().autopilot), "its capabilities")
        assert flight.uav.state() is State.UNINITIALIZED
        offset = Vector3(2.0, 1.0, 0.0)
        MotionCapture(flight, offset)
        flight.wait_for_state(State.LANDED_DISARMED)
        there = true_pose(flight.autopilot).position + offset
        flight.wait_for(lambda: flight.distance_m(there) < 0.05, "its place")
        flight.uav.set_home()
        flight.wait_for(lambda: flight.distance_m(Vector3()) < 0.05, "its new home")
        flight.let_pass(1.0)
        assert flight.distance_m(Vector3()) < 0.05


def test_what_is_sent_is_in_the_autopilots_axes_and_in_utc(flight: Flight) -> None:
    utc_s = flight.backend.utc_s()
    orientation = Quaternion.from_euler(0.1, 0.2, 0.3)
    pose = PoseStamped(Pose(Vector3(1.0, 2.0, 3.0), orientation), "map", utc_s)
    flight.uav.set_external_pose(pose, position_std_dev_m=0.1)
    flight.wait_for(lambda: bool(flight.autopilot.external_poses), "a pose")
    message = flight.autopilot.external_poses[0]
    assert (message.x, message.y, message.z) == pytest.approx((2.0, 1.0, -3.0))
    assert message.reset_counter == 0
    if isinstance(flight.autopilot, Px4):
        assert message.time_usec == pytest.approx(utc_s * 1e6, abs=1.0)
        w, x, y, z = message.q
        seen = Quaternion(x, y, z, w).to_euler()
        assert message.pose_covariance[0] == pytest.approx(0.01)
        assert math.isnan(message.pose_covariance[15])
        assert math.isnan(message.vx)
    else:
        assert message.usec == pytest.approx(utc_s * 1e6, abs=1.0)
        seen = (message.roll, message.pitch, message.yaw)
        assert message.covariance[0] == pytest.approx(0.01)
        assert all(map(math.isfinite, message.covariance))  # else it cannot be armed any more
    assert seen == pytest.approx((0.1, -0.2, enu_to_ned_yaw(0.3)), abs=1e-6)
