"""Parts of a telemetry sample, with their frame and time; shared by the client and its asyncio twin."""

from __future__ import annotations

from typing import TypeVar

from ual.errors import WrongStateError
from ual.geometry import PoseStamped, TwistStamped
from ual.types import Odometry, State, Telemetry

T = TypeVar("T")


def pose(telemetry: Telemetry) -> PoseStamped:
    return PoseStamped(_known(telemetry.pose, "pose", telemetry), telemetry.frame_id, telemetry.stamp_s)


def velocity(telemetry: Telemetry) -> TwistStamped:
    return TwistStamped(_known(telemetry.velocity, "velocity", telemetry), telemetry.frame_id, telemetry.stamp_s)


def odometry(telemetry: Telemetry) -> Odometry:
    return _known(telemetry.odometry, "odometry", telemetry)


def reference_pose(telemetry: Telemetry) -> PoseStamped | None:
    reference = telemetry.reference_pose
    return None if reference is None else PoseStamped(reference, telemetry.frame_id, telemetry.stamp_s)


def is_ready(telemetry: Telemetry) -> bool:
    return telemetry.state is not State.UNINITIALIZED


def is_idle(telemetry: Telemetry) -> bool:
    return telemetry.task is None


def _known(value: T | None, what: str, telemetry: Telemetry) -> T:
    if value is None:
        state = telemetry.state.name
        raise WrongStateError(f"{what} is not known: state is {state} ({telemetry.state_reason})", {"state": state})
    return value
