"""Setpoints and high-level commands for one firmware."""

from __future__ import annotations

from collections.abc import Mapping

from ual.geometry import Pose, Vector3, wrap_angle
from ual_daemon.backends.crazyflie import packets
from ual_daemon.backends.crazyflie.connecting import CONTROLLER, GAINS
from ual_daemon.backends.crazyflie.packets import CrtpPacket
from ual_daemon.backends.crazyflie.requests import CrtpRequest
from ual_daemon.backends.values import PositionSetpoint, Setpoint

_PID = (0, 1)
"""Values of ``stabilizer.controller``: automatic (PID), PID. Others (Mellinger, INDI, ...) take the whole motion."""
RESPONSE_S, CLIMB_RESPONSE_S = 0.3, 0.1
"""The times in which the PID controller follows a step of the velocity, horizontally and vertically."""
CORRECTION, CLIMB_CORRECTION = 0.5, 1.0
"""Gains in 1/s, beyond the PID controller's own, for errors of the position, horizontally and vertically. The
controller's gain of 2 leaves it 0.12 m beside a line that climbs at 0.4 m/s, this 0.08 m.
"""
MOST_CORRECTION_M = 0.5
HOLD_FLIGHT_S = 1.0
"""The duration of the high-level flight to where it already is."""
PEAK_SPEED_FACTOR = 2.1875
"""The highest speed of a polynomial of the 7th degree from rest to rest, for a mean speed of 1."""
BRAKING_ACCELERATION_M_S2 = 1.0
LANDING_SPEED_M_S = 0.5
SHORTEST_LANDING_S = 1.0
TOUCH_DOWN_DEPTH_M = 0.03
"""A landing ends this far below the ground, so that the motors stop on it and not above."""


class Encoder:
    """Encodes setpoints for one firmware."""

    def __init__(self, protocol: int, parameters: Mapping[str, float]) -> None:
        self._protocol = protocol
        self.is_pid = parameters.get(CONTROLLER, 1) in _PID
        x, _, z, yaw = (
            parameters.get(name, default) for name, default in zip(GAINS, (2.0, 2.0, 2.0, 6.0), strict=True)
        )
        self._lead_s, self._climb_lead_s, self._yaw_lead_s = 1.0 / max(x, 0.1), 1.0 / max(z, 0.1), 1.0 / max(yaw, 0.1)

    def encode(self, setpoint: Setpoint, here: Vector3 | None = None) -> CrtpPacket:
        """Returns the packet of a setpoint. `here` is where it is now; None if that is not known well."""
        if not isinstance(setpoint, PositionSetpoint):
            return packets.velocity_setpoint(setpoint.velocity, setpoint.yaw_rate_rad_s, self._protocol)
        if self.is_pid or not packets.fits_full_state(setpoint.position):
            return self._leading(setpoint, here)
        motion = setpoint.position, setpoint.velocity, setpoint.acceleration
        return packets.full_state(*motion, setpoint.yaw_rad, setpoint.yaw_rate_rad_s)

    def _leading(self, setpoint: PositionSetpoint, here: Vector3 | None) -> CrtpPacket:
        """Returns a position that lies ahead by the controller's lag, and by a part of what is missing.

        The PID controller takes no velocity with a position: it flies at its gain times the distance. So the position
        is ahead by the velocity divided by the gain.
        """
        velocity, acceleration = setpoint.velocity, setpoint.acceleration
        lead = Vector3(
            (velocity.x + acceleration.x * RESPONSE_S) * self._lead_s,
            (velocity.y + acceleration.y * RESPONSE_S) * self._lead_s,
            (velocity.z + acceleration.z * CLIMB_RESPONSE_S) * self._climb_lead_s,
        )
        yaw_rad = wrap_angle(setpoint.yaw_rad + setpoint.yaw_rate_rad_s * self._yaw_lead_s)
        correction = Vector3() if here is None else _corrected(setpoint.position - here)
        return packets.position_setpoint(setpoint.position + lead + correction, yaw_rad)

    def stay(self, position: Vector3, yaw_rad: float) -> CrtpRequest:
        """Returns the request to hover where it already does."""
        return self._go_to(position, yaw_rad, HOLD_FLIGHT_S)

    def stop(self, pose: Pose, velocity: Vector3) -> CrtpRequest:
        """Returns the request to come to rest, and to hover there."""
        return self._go_to(rest(pose, velocity).position, pose.yaw_rad, _braking_s(velocity))

    def land(self, height_m: float, ground_m: float, descent_speed_m_s: float) -> CrtpRequest:
        """Returns the request to land from a height on the ground, with a speed that is nowhere exceeded."""
        duration_s = max(
            SHORTEST_LANDING_S, PEAK_SPEED_FACTOR * (height_m - ground_m) / min(descent_speed_m_s, LANDING_SPEED_M_S)
        )
        packet = packets.land(ground_m - TOUCH_DOWN_DEPTH_M, duration_s)
        return CrtpRequest(packet, packet.data[:2])

    def _go_to(self, position: Vector3, yaw_rad: float, duration_s: float) -> CrtpRequest:
        packet = packets.go_to(position, yaw_rad, duration_s, self._protocol)
        return CrtpRequest(packet, packet.data[:2])


def rest(pose: Pose, velocity: Vector3) -> PositionSetpoint:
    """Returns the setpoint that stays where it comes to rest."""
    return PositionSetpoint(pose.position + velocity * (_braking_s(velocity) / PEAK_SPEED_FACTOR), pose.yaw_rad)


def _braking_s(velocity: Vector3) -> float:
    return max(HOLD_FLIGHT_S, PEAK_SPEED_FACTOR * velocity.norm() / BRAKING_ACCELERATION_M_S2)


def _corrected(missing: Vector3) -> Vector3:
    aside = missing.horizontal_norm()
    scale = min(CORRECTION, MOST_CORRECTION_M / aside) if aside > 0.0 else 0.0
    up = max(-MOST_CORRECTION_M, min(MOST_CORRECTION_M, missing.z * CLIMB_CORRECTION))
    return Vector3(missing.x * scale, missing.y * scale, up)
