"""Parts of a telemetry sample, with their frame and time; the same in the class, the client and its asyncio twin."""

from __future__ import annotations

from typing import TypeVar

from ual.errors import WrongStateError
from ual.geometry import PoseStamped, TwistStamped
from ual.types import Odometry, State, Telemetry

T = TypeVar("T")


def pose(telemetry: Telemetry) -> PoseStamped:
    """The pose. Raises `WrongStateError` while it is not known."""
    return PoseStamped(_known(telemetry.pose, "pose", telemetry), telemetry.frame_id, telemetry.stamp_s)


def velocity(telemetry: Telemetry) -> TwistStamped:
    """The velocity. Raises `WrongStateError` while it is not known."""
    return TwistStamped(_known(telemetry.velocity, "velocity", telemetry), telemetry.frame_id, telemetry.stamp_s)


def odometry(telemetry: Telemetry) -> Odometry:
    """The odometry. Raises `WrongStateError` while it is not known."""
    return _known(telemetry.odometry, "odometry", telemetry)


def reference_pose(telemetry: Telemetry) -> PoseStamped | None:
    """Where the UAV is told to be; None while no reference is given."""
    reference = telemetry.reference_pose
    return None if reference is None else PoseStamped(reference, telemetry.frame_id, telemetry.stamp_s)


def is_ready(telemetry: Telemetry) -> bool:
    """True when the state is not UNINITIALIZED."""
    return telemetry.state is not State.UNINITIALIZED


def is_idle(telemetry: Telemetry) -> bool:
    """True when no task runs."""
    return telemetry.task is None


def _known(value: T | None, what: str, telemetry: Telemetry) -> T:
    if value is None:
        state = telemetry.state.name
        raise WrongStateError(f"{what} is not known: state is {state} ({telemetry.state_reason})", {"state": state})
    return value
