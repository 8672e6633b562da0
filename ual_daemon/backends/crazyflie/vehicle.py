"""Description of a Crazyflie, from its parameters."""

from __future__ import annotations

from collections.abc import Mapping

from ual.types import Capability, Limits
from ual_daemon.backends.crazyflie.connecting import CONTROLLER, SPEEDS
from ual_daemon.backends.values import SetpointLoss, Takes, VehicleInfo

_DEFAULT_SPEED_M_S = 1.0
"""The firmware's default, where it does not say its own."""
_PID = (0, 1)
_PID_SHARE = 0.8
"""The part of its own largest velocity that the PID controller is requested: it corrects with the rest."""
_CLEARANCE_M = 0.1
"""It weighs 30 g, and flies at 0.3 m in most programs for it."""
_HORIZONTAL_M_S2, _VERTICAL_M_S2 = 1.5, 1.0
CAPABILITIES = frozenset(Capability) - {Capability.GEO}
"""It does not know where it is on Earth."""


def describe(
    parameters: Mapping[str, float],
    yaw_rate_rad_s: float,
    version: str = "",
    identity: str = "",
    *,
    is_simulation: bool,
) -> VehicleInfo:
    """Returns the description of a vehicle with these parameters. `identity` is empty while none is connected."""
    is_pid = parameters.get(CONTROLLER, 1) in _PID
    share = _PID_SHARE if is_pid else 1.0
    x, y, z = (share * parameters.get(name, _DEFAULT_SPEED_M_S) for name in SPEEDS)
    horizontal_m_s, vertical_m_s = max(0.1, min(x, y)), max(0.1, z)
    limits = Limits(horizontal_m_s, vertical_m_s, vertical_m_s, _HORIZONTAL_M_S2, _VERTICAL_M_S2, yaw_rate_rad_s)
    return VehicleInfo(
        clearance_m=_CLEARANCE_M,
        autopilot="Crazyflie",
        autopilot_version=version,
        is_simulation=is_simulation,
        capabilities=CAPABILITIES,
        limits=limits,
        takes=Takes.ALL if is_pid else Takes.POSITION | Takes.FEED_FORWARD,
        setpoint_loss=SetpointLoss.FALLS,
        has_safety_pilot=False,
        identity=identity,
    )
