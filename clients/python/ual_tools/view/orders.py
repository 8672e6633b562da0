"""Orders that an operator may give from the page, each with its question whether it would be accepted (a dry run)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ual import Uav
from ual.errors import WrongStateError
from ual.geometry import Pose, PoseStamped, Vector3
from ual.interface import Task
from ual.types import State
from ual_tools.output import plan_text, vector_text
from ual_tools.view.fleet import PageMember

_FARTHEST_GOAL_M = 5_000.0
_HOLDER = "ual view"


@dataclass(frozen=True)
class Order:
    """Order of the page: its name; the question, which returns the effect; and the function that begins it.

    `way` is where a straight flight ends, in `map`.
    """

    what: str
    ask: Callable[[Uav], str]
    begin: Callable[[Uav], Task | None]
    way: Vector3 | None = None


def take_off(height_m: float) -> Order:
    """Returns the order to take off to a height above the ground."""
    return Order(
        f"take off to {height_m:g} m",
        lambda uav: plan_text(uav.dry_run.take_off(height_m)),
        lambda uav: uav.take_off(height_m, blocking=False),
    )


def go_to(goal: Vector3) -> Order:
    """Returns the order to fly straight to a place in `map`. The heading stays."""
    pose = PoseStamped(Pose.at(*goal), "map")
    return Order(
        f"go to {vector_text(goal)} in map",
        lambda uav: plan_text(uav.dry_run.go_to_waypoint(pose)),
        lambda uav: uav.go_to_waypoint(pose, blocking=False),
        goal,
    )


def return_to_launch() -> Order:
    """Returns the order to fly home and land there."""
    return Order(
        "return to launch",
        lambda uav: plan_text(uav.dry_run.return_to_launch()),
        lambda uav: uav.return_to_launch(blocking=False),
    )


def recover() -> Order:
    """Returns the order to take control back from the safety pilot."""
    return Order(
        "recover from manual",
        lambda uav: plan_text(uav.dry_run.recover_from_manual()),
        lambda uav: uav.recover_from_manual(),
    )


def set_home() -> Order:
    """Returns the order to make the place where it stands its home."""

    def ask(uav: Uav) -> str:
        state = uav.state()
        if state not in (State.LANDED_DISARMED, State.LANDED_ARMED):
            raise WrongStateError(f"home is set on the ground, and it is {state.name}", {"state": state.name})
        return "odom moves here, and with it every goal, frame and fence that is given in it"

    return Order("set home", ask, lambda uav: uav.set_home())


def take_lease(member: PageMember) -> Order:
    """Returns the order to make the pages the only ones that fly a UAV."""

    def ask(uav: Uav) -> str:
        held = uav.lease_info()
        of = "" if held is None else f" {held.holder} loses it."
        return f"nobody else flies it then.{of} What is under way is aborted: the UAV holds, but a landing goes on"

    def begin(uav: Uav) -> None:
        member.lease = uav.lease(_HOLDER, take=True)

    return Order("take the lease", ask, begin)


def on_ground(origin: Sequence[float], direction: Sequence[float], ground_m: float) -> Vector3 | None:
    """Returns where a ray meets the level ground at a height; None where it does not, or only far away."""
    start, along = Vector3(*map(float, origin)), Vector3(*map(float, direction))
    if abs(along.z) < 1e-6:
        return None
    step = (ground_m - start.z) / along.z
    if not 0.0 < step * along.norm() < _FARTHEST_GOAL_M:
        return None
    return start + along * step
