"""The values between a backend and the layers above it: snapshots go up, setpoints go down. All are immutable.

The *local frame* is the autopilot's own: east, north, up in metres, with the autopilot's origin. Body axes are x
forward, y left, z up.
"""

from ual_daemon.backends.values.autopilot_fence import NO_FENCE, AutopilotFence, FenceLimit, Zone
from ual_daemon.backends.values.link_report import LinkReport
from ual_daemon.backends.values.modes import Cause, Control, LandedState, Mode, OnArming
from ual_daemon.backends.values.packet import Packet
from ual_daemon.backends.values.sample import NEVER_S, Sample
from ual_daemon.backends.values.setpoints import ExternalPose, PositionSetpoint, Setpoint, VelocitySetpoint
from ual_daemon.backends.values.snapshot import (
    Condition,
    ControlState,
    EarthReference,
    Estimator,
    LinkState,
    MotionState,
    SevereText,
    Snapshot,
)
from ual_daemon.backends.values.vehicle_info import (
    Freshness,
    SetpointLoss,
    Takes,
    VehicleInfo,
    VelocityGains,
    VelocityResponse,
    VelocityResponses,
)

__all__ = [
    "NEVER_S",
    "NO_FENCE",
    "AutopilotFence",
    "Cause",
    "Condition",
    "Control",
    "ControlState",
    "EarthReference",
    "Estimator",
    "ExternalPose",
    "FenceLimit",
    "Freshness",
    "LandedState",
    "LinkReport",
    "LinkState",
    "Mode",
    "MotionState",
    "OnArming",
    "Packet",
    "PositionSetpoint",
    "Sample",
    "Setpoint",
    "SetpointLoss",
    "SevereText",
    "Snapshot",
    "Takes",
    "VehicleInfo",
    "VelocityGains",
    "VelocityResponse",
    "VelocityResponses",
    "VelocitySetpoint",
    "Zone",
]
