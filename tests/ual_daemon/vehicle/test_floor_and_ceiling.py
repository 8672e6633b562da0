"""The floor and the ceiling, which hold without any configuration. In stepped time."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable

import pytest

from tests.ual_daemon.stepped import STEP_S, Stepped, at, stepped
from ual.errors import GeofenceError
from ual.geometry import Pose, Quaternion, Transform, Twist, TwistStamped, Vector3
from ual.types import AltitudeReference, Limits, State
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.light import LightBackend
from ual_daemon.backends.values import ControlState, LandedState, MotionState, Sample, Snapshot
from ual_daemon.flight.policy.geofence import geofence_of
from ual_daemon.flight.state import Estimate
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.settings import ConfigError, GeofenceSettings, VehicleSettings
from ual_daemon.tracker.drift import DriftCorrection
from ual_daemon.tracker.references import Hold, Velocity
from ual_daemon.vehicle.vehicle import Vehicle

FAST = {"vertical_speed_m_s": 10.0, "vertical_acceleration_m_s2": 4.0}
HIGH = VehicleSettings(ceiling_m=10.0)


def velocity(z: float, x: float = 0.0) -> TwistStamped:
    return TwistStamped(Twist(Vector3(x, 0.0, z), Vector3()), "")


def geo(uav: Stepped, altitude_m: float) -> object:
    return uav.prepare.go_to_waypoint_geo(37.4117, -6.0013, altitude_m, AltitudeReference.HOME)


@pytest.mark.parametrize("height_m", [9.9e6, 121.0])
def test_a_take_off_above_the_ceiling_is_refused(uav: Stepped, height_m: float) -> None:
    uav.arm()
    with pytest.raises(GeofenceError, match=r"above the ceiling \(ceiling_m: 120 in the configuration\)") as caught:
        uav.prepare.take_off(height_m)
    assert caught.value.metadata["setting"] == "ceiling_m"
    uav.run(1.0)
    assert uav.state is State.LANDED_ARMED
    uav.prepare.take_off(120.0)


@pytest.mark.parametrize("z", [-5.0, -1.0, 121.0])
@pytest.mark.parametrize(
    "command",
    [
        lambda uav, z: uav.prepare.go_to_waypoint(at(1.0, 1.0, z)),
        lambda uav, z: uav.prepare.go_to_waypoint(at(1.0, 1.0, z - 3.0, frame_id="uav_1/base_link")),
        geo,
        lambda uav, z: uav.prepare.follow_path([at(1.0, 1.0, 3.0), at(2.0, 1.0, z), at(3.0, 1.0, 3.0)]),
        lambda uav, z: uav.vehicle.commands.setpoints.set_pose(at(1.0, 1.0, z)),
        lambda uav, z: uav.vehicle.commands.plan(at(1.0, 1.0, z)),
    ],
    ids=["waypoint", "in the body's frame", "geo", "path", "pose", "dry run"],
)
def test_what_leads_below_the_ground_or_above_the_ceiling_is_refused(
    flying: Stepped, command: Callable[[Stepped, float], object], z: float
) -> None:
    before = flying.pose.position
    named = (
        "floor_m: 0, clearance_m: 0.5 in the configuration; z is up"
        if z < 0.0
        else "ceiling_m: 120 in the configuration"
    )
    with pytest.raises(GeofenceError, match=named):
        command(flying, z)
    flying.run(2.0)
    assert (flying.pose.position - before).norm() < 0.05


def test_a_refusal_says_how_far_below_the_ground_a_goal_is(flying: Stepped) -> None:
    why = (
        r"go_to_waypoint: 1\.0, 1\.0, -5\.0 in uav_1/odom is 5\.0 m below the ground of the take-off, below the floor "
        r"\(floor_m: 0, clearance_m: 0.5 in the configuration; z is up\)"
    )
    with pytest.raises(GeofenceError, match=why):
        flying.prepare.go_to_waypoint(at(1.0, 1.0, -5.0))


@pytest.mark.parametrize("ground_m", [-40.0, 300.0])
def test_both_are_measured_from_the_ground_of_the_take_off_wherever_that_is(ground_m: float) -> None:
    with stepped(light={"start": [0.0, 0.0, ground_m]}) as uav:
        uav.fly()
        odom_z = uav.pose.position.z - 3.0
        for height_m in (-1.0, 0.3, 121.0):
            with pytest.raises(GeofenceError):
                uav.prepare.go_to_waypoint(at(0.0, 0.0, odom_z + height_m))
        for height_m in (0.5, 120.0):
            uav.prepare.go_to_waypoint(at(0.0, 0.0, odom_z + height_m))


def test_set_home_does_not_move_them() -> None:
    with stepped(light={"start": [0.0, 0.0, 50.0]}) as uav:
        uav.vehicle.commands.set_home(set_z=True)
        uav.fly()
        uav.prepare.go_to_waypoint(at(0.0, 0.0, 119.9))
        with pytest.raises(GeofenceError):
            uav.prepare.go_to_waypoint(at(0.0, 0.0, -1.0))


def test_the_configuration_moves_and_lifts_each() -> None:
    with stepped(VehicleSettings(floor_m=-30.0, ceiling_m=None)) as uav:
        uav.fly()
        uav.prepare.go_to_waypoint(at(0.0, 0.0, 9000.0))
        uav.prepare.go_to_waypoint(at(0.0, 0.0, -29.0))
        with pytest.raises(GeofenceError, match="floor_m: -30"):
            uav.prepare.go_to_waypoint(at(0.0, 0.0, -31.0))
    with stepped(VehicleSettings(floor_m=None, ceiling_m=None)) as uav:
        uav.fly()
        uav.prepare.go_to_waypoint(at(0.0, 0.0, -31.0))


def test_a_ceiling_below_the_floor_is_refused() -> None:
    with pytest.raises(ConfigError, match="ceiling_m: is not above floor_m"), stepped(VehicleSettings(ceiling_m=-1.0)):
        pass


def test_they_hold_next_to_a_configured_fence() -> None:
    fence = GeofenceSettings(polygon=((-50.0, -50.0), (50.0, -50.0), (0.0, 50.0)), max_height_m=500.0)
    with stepped(VehicleSettings(geofence=fence)) as uav:
        uav.fly()
        with pytest.raises(GeofenceError, match="ceiling_m: 120"):
            uav.prepare.go_to_waypoint(at(0.0, 0.0, 400.0))
        with pytest.raises(GeofenceError, match="outside the geofence"):
            uav.prepare.go_to_waypoint(at(60.0, 0.0, 3.0))


@pytest.mark.parametrize("speed_m_s", [1.2, 10.0])
def test_a_velocity_stops_above_the_ground_and_below_the_ceiling(speed_m_s: float) -> None:
    with stepped(VehicleSettings(ceiling_m=40.0), light=FAST if speed_m_s > 2.0 else None) as uav:
        uav.fly(20.0)
        named: set[str] = set()
        for sign in (-1.0, 1.0):
            was_refused, extremes = False, (20.0, 20.0)
            for _ in range(round(60.0 / STEP_S)):
                try:
                    uav.vehicle.commands.setpoints.set_velocity(velocity(sign * speed_m_s))
                except GeofenceError as error:
                    was_refused = True
                    named.add(error.metadata["setting"])
                uav.run(STEP_S)
                z = uav.pose.position.z
                extremes = (min(extremes[0], z), max(extremes[1], z))
                if was_refused and uav.speed < 0.01:
                    break
            assert was_refused
            assert extremes[0] > 0.4
            assert extremes[1] < 40.7
            assert uav.state is State.FLYING_AUTO
            edge_m = extremes[0] - 0.5 if sign < 0.0 else 40.0 - extremes[1]
            assert edge_m < 0.5 * speed_m_s**2
        assert named == {"floor_m", "ceiling_m"}


def test_a_velocity_that_is_not_renewed_stops_above_the_ground() -> None:
    with stepped(light=FAST) as uav:
        uav.fly(20.0)
        lowest = 20.0
        for _ in range(round(10.0 / STEP_S)):
            with contextlib.suppress(GeofenceError):
                if uav.pose.position.z > 8.0:
                    uav.vehicle.commands.setpoints.set_velocity(velocity(-10.0))
            uav.run(STEP_S)
            lowest = min(lowest, uav.pose.position.z)
        assert lowest > 0.0


def test_landing_is_not_refused(flying: Stepped) -> None:
    flying.end(flying.prepare.land().begin().future)
    assert flying.state in (State.LANDED_ARMED, State.LANDED_DISARMED)


@pytest.mark.parametrize("seed", range(5))
def test_a_noisy_estimate_refuses_no_take_off_and_no_hover_at_low_height(seed: int) -> None:
    noise = {"position_noise_m": 0.05, "velocity_noise_m_s": 0.1, "seed": seed}
    with stepped(light=noise) as uav:
        uav.run(1.0)
        uav.arm()
        uav.end(uav.prepare.take_off(1.0).begin().future)
        here = uav.pose.position
        for step in range(200):
            uav.vehicle.commands.setpoints.set_velocity(velocity(0.1 * math.sin(step), 0.3))
            uav.run(STEP_S)
        uav.vehicle.commands.setpoints.set_pose(at(here.x, here.y, 0.6))
        uav.run(5.0)
        uav.end(uav.prepare.go_to_waypoint(at(here.x, here.y, 0.7)).begin().future)


def test_a_height_that_drifts_below_the_ground_while_it_hovers_refuses_only_a_descent() -> None:
    configured = VehicleSettings()
    geofence = geofence_of(configured, FrameResolver("uav_1", configured), 0.5)
    geofence.observe(standing(0.4), Estimate(State.LANDED_ARMED, ""))
    here = Snapshot(
        0.0,
        motion=MotionState(pose=Sample(Pose.at(0.0, 0.0, 0.0), 0.0), velocity=Sample(Twist(Vector3(0, 0, -0.3)), 0.0)),
    )
    for z in (0.0, 0.15):
        wanted = Velocity(Twist(Vector3(1.0, 0.0, z)), DriftCorrection(), in_body=False, expires_s=1.0)
        geofence.admit("velocity", wanted, Limits(), here)
    geofence.admit("set_pose", Hold(Vector3(2.0, 0.0, 0.9), 0.0), Limits(), here)
    for z in (-0.15, -1.0):
        sinking = Velocity(Twist(Vector3(0.0, 0.0, z)), DriftCorrection(), in_body=False, expires_s=1.0)
        with pytest.raises(GeofenceError):
            geofence.admit("velocity", sinking, Limits(), here)


def standing(z: float) -> Snapshot:
    return Snapshot(
        0.0,
        control=ControlState(landed=Sample(LandedState.ON_GROUND, 0.0)),
        motion=MotionState(pose=Sample(Pose.at(0.0, 0.0, z), 0.0)),
    )


def test_a_uav_above_the_ceiling_comes_back_but_does_not_climb() -> None:
    with stepped(HIGH) as uav:
        uav.fly()
        uav.sim.pilot_take_over()
        uav.sim.pilot_move_sticks(up=1.0)
        uav.until(lambda: uav.pose.position.z > 14.0)
        uav.sim.pilot_move_sticks()
        uav.run(2.0)
        uav.end(uav.vehicle.commands.recover_from_manual().begin())
        with pytest.raises(GeofenceError, match="ceiling_m: 10"):
            uav.prepare.go_to_waypoint(at(0.0, 0.0, 16.0))
        with pytest.raises(GeofenceError, match="ceiling_m: 10"):
            uav.vehicle.commands.setpoints.set_velocity(velocity(1.0))
        uav.vehicle.commands.setpoints.set_velocity(velocity(-1.0))
        uav.end(uav.prepare.go_to_waypoint(at(0.0, 0.0, 5.0)).begin().future)


def test_a_goal_in_a_moving_frame_does_not_lead_below_the_ground(flying: Stepped) -> None:
    def put(z: float) -> None:
        flying.vehicle.frame_editor.add(Transform(Vector3(3.0, 0.0, z), Quaternion(), "map", "boat"))

    put(3.0)
    flying.run(STEP_S)
    put(3.0)
    flying.prepare.go_to_waypoint(at(0.0, 0.0, 0.0, frame_id="boat")).begin()
    flying.run(5.0)
    put(-5.0)
    flying.run(10.0)
    assert flying.pose.position.z > 2.0
    assert flying.state is State.FLYING_AUTO
    for command in (flying.vehicle.commands.setpoints.set_pose, flying.prepare.go_to_waypoint):
        with pytest.raises(GeofenceError, match="floor_m: 0"):
            command(at(0.0, 0.0, 0.0, frame_id="boat"))


def test_a_daemon_that_was_started_in_flight_measures_from_the_autopilots_home() -> None:
    """Its ground is not known then, and the refusal says what is taken for it."""
    with stepped(light={"start": [0.0, 0.0, 0.0]}) as uav:
        uav.fly(10.0)
        snapshot = uav.vehicle.backend.snapshot()
        backend = LightBackend(BackendOptions("uav_2", settings={"speed_factor": 0}))
        vehicle = Vehicle(backend)
        backend.snapshot = lambda: snapshot  # type: ignore[method-assign]
        prepare = type(uav.prepare)(vehicle)
        prepare.go_to_waypoint(at(0.0, 0.0, 5.0))
        with pytest.raises(GeofenceError, match=r"5\.0 m below the autopilot's home \(UAL has not seen the take-off\)"):
            prepare.go_to_waypoint(at(0.0, 0.0, -5.0))


# --- The clearance ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("z", [0.0, 0.2, 0.39])
@pytest.mark.parametrize(
    "command",
    [
        lambda uav, z: uav.prepare.go_to_waypoint(at(4.0, 2.0, z)),
        lambda uav, z: uav.prepare.follow_path([at(4.0, 2.0, z), at(4.0, 4.0, 3.0)]),
        lambda uav, z: uav.vehicle.commands.setpoints.set_pose(at(4.0, 2.0, z)),
    ],
    ids=["waypoint", "path", "pose"],
)
def test_a_goal_on_the_ground_is_refused_because_of_the_clearance(
    flying: Stepped, command: Callable[[Stepped, float], object], z: float
) -> None:
    with pytest.raises(GeofenceError, match=r"nearer to the floor than its clearance of 0\.5 m .*to come down, land"):
        command(flying, z)
    command(flying, 0.5)


def test_one_message_moves_the_clearance() -> None:
    with stepped(VehicleSettings(clearance_m=0.0)) as uav:
        uav.fly()
        uav.prepare.go_to_waypoint(at(1.0, 0.0, 0.05))
    with stepped(VehicleSettings(clearance_m=2.0)) as uav:
        uav.fly()
        with pytest.raises(GeofenceError, match="clearance of 2 m"):
            uav.prepare.go_to_waypoint(at(1.0, 0.0, 1.5))


def test_a_take_off_may_end_below_the_clearance_and_fly_on_there_by_velocities() -> None:
    with stepped(light={"position_noise_m": 0.05, "velocity_noise_m_s": 0.1}) as uav:
        uav.fly(0.3)
        for _ in range(100):
            uav.vehicle.commands.setpoints.set_velocity(velocity(0.0, 0.5))
            uav.run(STEP_S)
        with pytest.raises(GeofenceError, match="could not stop above the floor"):
            uav.vehicle.commands.setpoints.set_velocity(velocity(-0.1))
        uav.end(uav.prepare.go_to_waypoint(at(1.0, 0.0, 1.0)).begin().future)


def test_the_ground_stays_where_it_was_while_the_uav_rises_from_it() -> None:
    with stepped() as uav:
        uav.arm()
        before = uav.vehicle.geofence()
        uav.end(uav.prepare.take_off(2.0).begin().future)
        assert uav.vehicle.geofence() == before
