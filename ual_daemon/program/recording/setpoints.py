"""Setpoints in a recording: what the autopilot was commanded to fly, in its local frame."""

from __future__ import annotations

import json

from ual.geometry import Vector3
from ual.recording.recorder import Entry, Output
from ual.recording.topics import json_schema, of_json
from ual_daemon.backends.values import PositionSetpoint, Setpoint

_VECTOR = {"type": "object", "properties": {axis: {"type": "number"} for axis in "xyz"}}
SETPOINT_SCHEMA = json_schema(
    "UalSetpoint",
    "What was sent to the autopilot: a position with feed-forward, or a velocity; in its local frame, ENU, metres.",
    kind={"type": "string", "enum": ["position", "velocity"]},
    position=_VECTOR,
    velocity=_VECTOR,
    acceleration=_VECTOR,
    yaw_rad={"type": "number"},
    yaw_rate_rad_s={"type": "number"},
)


class SetpointTopic:
    """Writes the setpoints of one UAV."""

    def __init__(self, ns: str) -> None:
        self._topic = of_json(f"/{ns}/setpoints", SETPOINT_SCHEMA)

    def write(self, output: Output, entry: Entry) -> None:
        """Writes a setpoint that was sent."""
        setpoint: Setpoint = entry.value
        is_position = isinstance(setpoint, PositionSetpoint)
        values: dict[str, object] = {"kind": "position" if is_position else "velocity"}
        if isinstance(setpoint, PositionSetpoint):
            values |= {
                "position": _xyz(setpoint.position),
                "yaw_rad": setpoint.yaw_rad,
                "acceleration": _xyz(setpoint.acceleration),
            }
        values |= {"velocity": _xyz(setpoint.velocity), "yaw_rate_rad_s": setpoint.yaw_rate_rad_s}
        output.write(self._topic, json.dumps(values).encode(), entry.log_ns, entry.log_ns)


def _xyz(vector: Vector3) -> dict[str, float]:
    return {"x": vector.x, "y": vector.y, "z": vector.z}
