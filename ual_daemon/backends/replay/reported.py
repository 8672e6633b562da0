"""Snapshots from recorded samples: of a flight without raw packets, all is reported as it was."""

from __future__ import annotations

from ual.types import State, Telemetry
from ual_daemon.backends.values import Control, Estimator, Mode, Recorded, Sample, Snapshot


def snapshot_of(sample: Telemetry, time_s: float) -> Snapshot:
    """Returns a sample as a snapshot, at a time of the backend's clock.

    Only what the autopilot had said is in it by itself, for what is computed from it, such as transforms.
    """
    body = sample.odometry
    is_known = sample.state is not State.UNINITIALIZED
    return Snapshot(
        time_s=time_s,
        heard_s=time_s,
        stamp_s=sample.stamp_s,
        armed=Sample(sample.armed, time_s),
        mode=Sample(Mode(sample.flight_mode, Control.OTHER), time_s),
        estimator=Sample(Estimator(is_good=is_known, why=sample.state_reason), time_s),
        pose=None if body is None else Sample(body.pose, time_s),
        velocity=None if sample.velocity is None else Sample(sample.velocity, time_s),
        position_geo=sample.position_geo,
        battery=sample.battery,
        gps=sample.gps,
        status_text=sample.status_text,
        health=sample.health,
        recorded=Recorded(sample, is_whole=True),
    )
