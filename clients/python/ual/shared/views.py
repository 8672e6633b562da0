"""Parts of a telemetry sample with their frame and time. The class interface and both clients share them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from ual.errors import FrameLostError, InvalidArgumentError, UalTimeoutError, WrongStateError
from ual.geometry import PoseStamped, TwistStamped
from ual.types import Odometry, State, Telemetry

T = TypeVar("T")


def pose(telemetry: Telemetry) -> PoseStamped:
    """Returns the pose. Raises `WrongStateError` while it is not known, `FrameLostError` while its frame is lost."""
    return PoseStamped(_known(telemetry.pose, "pose", telemetry), telemetry.frame_id, telemetry.stamp_s)


def velocity(telemetry: Telemetry) -> TwistStamped:
    """Returns the velocity. Raises `WrongStateError` while it is not known."""
    return TwistStamped(_known(telemetry.velocity, "velocity", telemetry), telemetry.frame_id, telemetry.stamp_s)


def odometry(telemetry: Telemetry) -> Odometry:
    """Returns the odometry. Raises as `pose`."""
    return _known(telemetry.odometry, "odometry", telemetry)


def reference_pose(telemetry: Telemetry) -> PoseStamped | None:
    """Returns the pose that the autopilot gets as its reference; None while there is none."""
    reference = telemetry.reference_pose
    return None if reference is None else PoseStamped(reference, telemetry.frame_id, telemetry.stamp_s)


def state(telemetry: Telemetry) -> State:
    """Returns the state."""
    return telemetry.state


def is_ready(telemetry: Telemetry) -> bool:
    """Returns whether the state is other than UNINITIALIZED."""
    return telemetry.state is not State.UNINITIALIZED


def is_idle(telemetry: Telemetry) -> bool:
    """Returns whether no task runs."""
    return telemetry.task is None


def _known(value: T | None, what: str, telemetry: Telemetry) -> T:
    if value is None:
        state = telemetry.state.name
        if telemetry.frame_lost and telemetry.velocity is not None:
            raise FrameLostError(f"{what} is not known: {telemetry.frame_lost}", {"state": state})
        raise WrongStateError(f"{what} is not known: state is {state} ({telemetry.state_reason})", {"state": state})
    return value


def subscription_text(ns: str, rate_hz: float, *, is_closed: bool) -> str:
    """Returns what Python prints of a subscription."""
    rate = f"{rate_hz:g} Hz" if rate_hz else "every update"
    return f"<Subscription to {ns or 'the only UAV'}, {rate}{', closed' if is_closed else ''}>"


def require_states(states: Sequence[State]) -> None:
    """Raises `InvalidArgumentError` unless there is at least one state, and nothing else."""
    if not states or not all(isinstance(state, State) for state in states):
        known = ", ".join(state.name for state in State)
        raise InvalidArgumentError(f"states: give at least one State ({known})", {"field": "states"})


def not_reached(states: Sequence[State], telemetry: Telemetry, limit_s: float | None) -> UalTimeoutError:
    """Returns the error of waiting for states that did not come in time."""
    wanted = " or ".join(state.name for state in states)
    return UalTimeoutError(
        f"the state is not {wanted} after {limit_s:g} s, but {telemetry.state.name}: {telemetry.state_reason}",
        {"state": telemetry.state.name, "needed": wanted},
    )
