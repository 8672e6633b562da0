"""Command in ROS: a service or an action, and the member of the client that it calls."""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import reduce
from typing import Any, NamedTuple, TypeAlias

import ual
from ual.contract.method import Method
from ual.contract.methods import METHODS
from ual.interface import DryRun
from ual_ros2.messages import Entity, Message

Serves: TypeAlias = Callable[[ual.aio.Uav, Message], Awaitable[Mapping[str, Any]]]
"""Serves a request: calls the daemon, and returns the fields of the answer."""


Flyer: TypeAlias = ual.aio.Uav | DryRun[Any]
"""Client that flies, or one that only returns the effect: both have the same members."""
Flies: TypeAlias = Callable[[Flyer, Message], Awaitable[object]]


class Service(NamedTuple):
    """A service or an action as it follows from the contract.

    Attributes:
        name: Its name below ``<ns>/ual/``.
        kind: The type of its messages.
        method: The method of the contract that it calls.
        frames: The fields of a request that name the frames that it is given in.

    """

    name: str
    kind: Entity
    method: str
    frames: tuple[str, ...] = ()

    def frames_of(self, request: Message) -> list[str]:
        """Returns the frames that a request is given in."""
        return [str(reduce(getattr, path.split("."), request)) for path in self.frames]


def _none(_: Message) -> Iterable[Any]:
    return ()


def _nothing(_: object) -> Mapping[str, Message]:
    return {}


def _no_more(_: Message, __: Message) -> bool:
    return True


@dataclass(frozen=True)
class RosCommand:
    """A service or action below ``<ns>/ual/``."""

    name: str
    kind: Entity
    """The type of its messages."""
    call: Callable[[ual.aio.Uav, Message], Awaitable[object]]
    frames: Callable[[Message], Iterable[str]] = _none
    """The frames that the request is given in."""
    told: Callable[[Any], Mapping[str, Message]] = _nothing
    """The further fields of the response, of what the call has returned."""
    stamps: Callable[[Message], Iterable[Message]] = _none
    """The stamps of the request that count: they are made UTC before the call."""
    changes_frames: bool = False
    """Whether tf has others afterwards."""
    method: str = ""
    """The method of the contract that it calls. Empty: that of its own name, as go_to_waypoint calls GoToWaypoint."""

    @property
    def facts(self) -> Method:
        """The facts of the method, from the contract."""
        words = self.name.rpartition("/")[2].split("_")
        return METHODS[self.method or "".join(each.capitalize() for each in words)]

    @property
    def needs_lease(self) -> bool:
        """Whether it is refused while the node has lost its lease."""
        return self.facts.needs_lease

    @property
    def may_be_late(self) -> bool:
        """Whether it is also obeyed long after it was sent, as it ends a motion or changes no flight."""
        return self.facts.stale_after_s == math.inf


@dataclass(frozen=True)
class ActionCommand(RosCommand):
    """An action, and whether it can be cancelled where there is a safety pilot: take-offs and landings cannot."""

    can_be_cancelled: bool = True
    is_task: bool = True
    """Whether it flies a task, of which its feedback tells."""
    also: Callable[[Message, Message], bool] = _no_more
    """Fills what the feedback of a goal has beside the task. Returns whether that is known."""

    def flies(self, goal: Message) -> bool:
        """Returns whether a goal flies a task, and does not only ask what would be flown."""
        return self.is_task and not getattr(goal, "dry_run", False)
