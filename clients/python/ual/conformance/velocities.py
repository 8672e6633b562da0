"""Checks of velocity references."""

from __future__ import annotations

import math

from ual.conformance.check import check
from ual.conformance.flight import CannotRunError, Flight, mean, position, require, speed, velocity, yaw_rad
from ual.geometry import Twist, TwistStamped, Vector3, wrap_angle
from ual.types import Capability, State

_VELOCITY = (Capability.VELOCITY,)
_WATCHDOG_S = 0.5
_FLYING = State.FLYING_AUTO
_SPEED_M_S = 1.5
_STEADY_FLIGHT_S = 1.0
# In this time an estimate drifts by at most `Tolerances.wander_m`.
_WANDER_TIME_S = 1.0
# A faster UAV would leave the few metres that checks may use.
_FASTEST_TEST_M_S = 3.0


@check(_FLYING, capabilities=_VELOCITY, moves="5 m ahead")
def flies_a_velocity_and_stops_without(flight: Flight) -> None:
    """It flies a velocity that is sent repeatedly; without a new one within 0.5 s it stops and holds its position."""
    uav, t = flight.uav, flight.tolerances
    start = flight.position()
    wanted = Vector3(min(_SPEED_M_S, flight.info.limits.horizontal_speed_m_s), 0.0, 0.0)
    with flight.recording() as recorded:
        last = flight.fly_velocity(
            lambda: uav.set_velocity(Twist(wanted)), lambda sample: position(sample).x - start.x >= 3.5, "3.5 m ahead"
        )
        steady = [sample for sample in recorded() if last.stamp_s - _STEADY_FLIGHT_S <= sample.stamp_s <= last.stamp_s]
    off_m_s = (mean(map(velocity, steady)) - wanted).norm()
    require(off_m_s <= t.speed_m_s, f"the velocity is {off_m_s:.2f} m/s off")
    aside_m = abs(position(last).y - start.y)
    require(aside_m <= t.drift_m, f"it went {aside_m:.2f} m aside")
    stopped = flight.wait(flight.is_slow, "stop without a new velocity", 5.0)
    brake_s = _SPEED_M_S / flight.info.limits.horizontal_acceleration_m_s2
    took_s, allowed_s = stopped.stamp_s - last.stamp_s, t.patience * (_WATCHDOG_S + brake_s) + 0.5
    require(took_s <= allowed_s, f"it stopped only after {took_s:.1f} s")
    flight.require_stays("after the stop")


@check(_FLYING, capabilities=_VELOCITY, moves="4 m aside, a quarter turn")
def a_velocity_of_the_body_turns_with_it(flight: Flight) -> None:
    """A velocity in base_link points where the nose points."""
    uav, body = flight.uav, f"{flight.uav.ns}/base_link"
    turned = flight.goal(0.0, 0.0, 0.0, math.pi / 2)
    uav.go_to_waypoint(turned)
    start = flight.position()
    ahead = turned.orientation.rotate(Vector3(1.0, 0.0, 0.0))
    forward = TwistStamped(Twist(Vector3(_SPEED_M_S, 0.0, 0.0)), body)
    last = flight.fly_velocity(
        lambda: uav.set_velocity(forward), lambda sample: (position(sample) - start).dot(ahead) >= 3.0, "3 m ahead"
    )
    moved = position(last) - start
    aside_m = (moved - ahead * moved.dot(ahead)).norm()
    require(aside_m <= flight.tolerances.drift_m, f"it went {aside_m:.2f} m aside")
    flight.stop()


@check(_FLYING, capabilities=_VELOCITY, moves="a turn to the left")
def turns_with_a_rate(flight: Flight) -> None:
    """A positive yaw rate turns it to the left, in place."""
    uav = flight.uav
    start, before_rad = flight.position(), yaw_rad(uav.telemetry())
    turn = Twist(angular=Vector3(0.0, 0.0, 0.4))
    flight.fly_velocity(
        lambda: uav.set_velocity(turn),
        lambda sample: math.radians(30.0) <= wrap_angle(yaw_rad(sample) - before_rad) <= math.radians(90.0),
        "a turn to the left by 30°",
    )
    flight.stop()
    moved_m = (flight.position() - start).norm()
    require(moved_m <= flight.tolerances.drift_m, f"it left its position by {moved_m:.2f} m")


@check(_FLYING, capabilities=_VELOCITY, moves="5 m aside")
def scales_a_velocity_down(flight: Flight) -> None:
    """A velocity beyond the limits is scaled down, its direction kept."""
    limit_m_s = flight.info.limits.horizontal_speed_m_s
    if limit_m_s > _FASTEST_TEST_M_S:
        raise CannotRunError(f"its limit of {limit_m_s:g} m/s needs more room than a check may use")
    uav, t = flight.uav, flight.tolerances
    start = flight.position()
    direction = Vector3(0.8, -0.6, 0.0)
    wanted = Twist(direction * (5 * limit_m_s))
    with flight.recording() as recorded:
        flight.fly_velocity(
            lambda: uav.set_velocity(wanted), lambda sample: (position(sample) - start).norm() >= 3.5, "3.5 m aside"
        )
        samples = recorded()
    flight.stop()
    fastest_m_s, allowed_m_s = max(map(speed, samples)), 1.1 * limit_m_s + t.wander_m / _WANDER_TIME_S
    require(fastest_m_s <= allowed_m_s, f"it flew {fastest_m_s:.2f} m/s, its limit is {limit_m_s:g}")
    moved = position(samples[-1]) - start
    aside_m = (moved - direction * moved.dot(direction)).norm()
    require(aside_m <= t.drift_m, f"it went {aside_m:.2f} m aside")


CHECKS = (
    flies_a_velocity_and_stops_without,
    a_velocity_of_the_body_turns_with_it,
    turns_with_a_rate,
    scales_a_velocity_down,
)
