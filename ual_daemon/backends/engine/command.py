"""A command to an autopilot as data: what is sent, what shows its effect, and whether it may ever be repeated."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from enum import Enum, auto
from typing import Generic, NamedTuple, TypeVar

from ual.errors import WrongStateError
from ual_daemon.backends.engine.limits import UNSENT_COMMAND_S
from ual_daemon.backends.values import LandedState, Mode, Snapshot

R = TypeVar("R")

FLYING = "mode"
"""The group of the commands that change control of the flight."""
ARMING = "arm"
"""The group of arming and disarming."""

Shows = Callable[[Snapshot, float], bool]
"""Whether a snapshot shows the effect of what was first sent at a time: in data that came after it."""


class NotYetError(WrongStateError):
    """A command needs what the autopilot has not sent yet: it is retried for a while (`TEMPORARY_REFUSAL_S`)."""


class Repeat(NamedTuple):
    """Whether a command may be sent again: at this interval in seconds, and so often in all.

    `after_answer_s` is for a bridge that may execute a call late. It is called again only once the call was answered.
    The autopilot must also have reported, so many seconds after the answer, what shows that there was no effect.
    """

    every_s: float = math.inf
    most: int = 1
    after_answer_s: float | None = None


ONCE = Repeat()


class Verdict(Enum):
    """Meaning of an answer to a command."""

    ACCEPTED = auto()
    IN_PROGRESS = auto()
    PASSED_ON = auto()
    """A bridge has sent it; the autopilot has not answered."""
    REFUSED = auto()
    REPLACED = auto()
    """An order was replaced by a newer one: this one, once it was in progress; until then, one from before."""
    LOST = auto()
    """No answer comes any more; it may have been executed, or still be."""


@dataclass(frozen=True, slots=True)
class _ShowsArmed:
    is_armed: bool

    def __call__(self, snapshot: Snapshot, since_s: float) -> bool:
        armed = snapshot.control.armed
        return armed is not None and armed.time_s > since_s and armed.value is self.is_armed


@dataclass(frozen=True, slots=True)
class Command(Generic[R]):
    """A command.

    Attributes:
        what: Human-readable: "arm".
        request: What is sent, of the backend.
        group: Of one group only the newest command is kept: `FLYING`, `ARMING`, or one of the backend's. A command
            without a group only requests data.
        key: What the answers say of which command they are for (MAVLink: the id). Of one key one is unanswered at a
            time. None: answers can be distinguished.
        mode: The name of the mode that it leads to, in the group `FLYING`.
        own_modes: Returns whether a mode is one to which it leads, where that is not only the one of this name.
        shows: Returns whether a snapshot shows its effect, whatever was answered. None: only answers do.
        repeat: Whether it may ever be sent again.
        setpoints_before_s: For how long setpoints must have been sent before it.
        mode_age_s: The present mode must have been reported within this time, where a bridge executes it late.
        accepts_count: How often the autopilot accepts it.
        waits: Returns why it has to wait, human-readable; empty if it need not.
        refusal_is_final: False: it goes on until the end of its repetitions, and a refusal counts then.
        is_harmless: Executed late, it takes nothing from anybody: no silence keeps it back.
        unsent_s: Once it could not leave for so long, it does not leave any more. Requests for data wait without end.
        is_told_by_answer: Nothing but an answer shows whether it was obeyed, and an answer that may be of another
            command with its key is not taken.
        explain: What makes the autopilot give the reason of a refusal.
        then: What follows once it is accepted, or its effect shows.
        on_done: Called then, on the loop's thread.
        details: What an error about it has as metadata: names and values.

    """

    what: str
    request: R
    group: str = ""
    key: Hashable | None = None
    mode: str = ""
    own_modes: Callable[[Mode], bool] | None = field(default=None, compare=False)
    shows: Shows | None = field(default=None, compare=False)
    repeat: Repeat = ONCE
    setpoints_before_s: float = 0.0
    mode_age_s: float = math.inf
    accepts_count: int = 1
    waits: Callable[[Snapshot], str] | None = field(default=None, compare=False)
    refusal_is_final: bool = True
    is_harmless: bool = False
    unsent_s: float = UNSENT_COMMAND_S
    is_told_by_answer: bool = False
    explain: R | None = None
    then: Command[R] | None = None
    on_done: Callable[[], None] | None = field(default=None, compare=False)
    details: tuple[tuple[str, str], ...] = ()

    @property
    def is_action(self) -> bool:
        """Whether it does something, so that it must not be executed where others may fly meanwhile."""
        return bool(self.group) and not self.is_harmless

    @property
    def arms(self) -> bool:
        """Whether it arms."""
        return self.group == ARMING and isinstance(self.shows, _ShowsArmed) and self.shows.is_armed

    def leads_to(self, mode: Mode) -> bool:
        """Returns whether a mode is one to which it leads."""
        return mode.name == self.mode if self.own_modes is None else self.own_modes(mode)


def shows_armed(*, is_armed: bool) -> Shows:
    """For `Command.shows`: it is armed, or disarmed."""
    return _ShowsArmed(is_armed)


def shows_mode(name: str) -> Shows:
    """For `Command.shows`: the autopilot is in the mode of this name."""

    def shows(snapshot: Snapshot, since_s: float) -> bool:
        mode = snapshot.control.mode
        return mode is not None and mode.time_s > since_s and mode.value.name == name

    return shows


def shows_landed(*states: LandedState) -> Shows:
    """For `Command.shows`: the autopilot is in one of these landed states."""

    def shows(snapshot: Snapshot, since_s: float) -> bool:
        landed = snapshot.control.landed
        return landed is not None and landed.time_s > since_s and landed.value in states

    return shows
