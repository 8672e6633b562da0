"""What a command is: a service or an action, and the member of the client that it calls."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import ual
from ual_ros2.messages import Entity, Message


def _none(_: Message) -> Iterable[Any]:
    return ()


def _nothing(_: object) -> Mapping[str, Message]:
    return {}


def _no_more(_: Message, __: Message) -> bool:
    return True


@dataclass(frozen=True)
class Command:
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
    needs_lease: bool = True
    """Whether it flies: what does not is not refused while the node has lost its lease."""
    changes_frames: bool = False
    """Whether tf has others afterwards."""
    may_be_late: bool = False
    """Whether it is also obeyed long after it was sent, as it ends a motion. So is what needs no lease."""


@dataclass(frozen=True)
class Action(Command):
    """An action, and whether it can be cancelled where there is a safety pilot: take-offs and landings cannot."""

    can_be_cancelled: bool = True
    is_task: bool = True
    """Whether it flies a task, of which its feedback tells."""
    also: Callable[[Message, Message], bool] = _no_more
    """Fills what the feedback of a goal has beside the task. Returns whether that is known."""

    def flies(self, goal: Message) -> bool:
        """Returns whether a goal flies a task, and does not only ask what would be flown."""
        return self.is_task and not getattr(goal, "dry_run", False)
