"""The definition of a check and of its result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from ual.conformance.flight import Flight
from ual.types import Capability, State


class Need(Enum):
    """Need of a check beyond a UAV that answers."""

    MOTION = "that the UAV may move"
    PILOT = "a simulated safety pilot"
    ARMING = "the permission to arm"
    NO_ARMING = "a daemon that may not arm"


@dataclass(frozen=True)
class Check:
    """One check. It can start in each of the states `starts`; if the UAV is in none of them, it is brought to the
    first.

    `moves` describes how the UAV moves in it; empty if it does not move.
    """

    name: str
    description: str
    run: Callable[[Flight], None]
    starts: tuple[State, ...]
    moves: str
    needs: frozenset[Need]
    capabilities: frozenset[Capability]


class Outcome(Enum):
    """Outcome of a check."""

    PASSED = "passed"
    FAILED = "failed"
    SKIPPED = "skipped"


@dataclass(frozen=True)
class Result:
    """Outcome of a check, why it did not pass, and its duration by the wall clock."""

    check: Check
    outcome: Outcome
    why: str = ""
    duration_s: float = 0.0


LANDED = (State.LANDED_ARMED, State.LANDED_DISARMED)
READY = (State.LANDED_DISARMED, State.LANDED_ARMED, State.FLYING_AUTO)
_IN_FLIGHT = (State.FLYING_AUTO, State.FLYING_MANUAL)


def check(
    *starts: State,
    moves: str = "",
    needs: tuple[Need, ...] = (),
    capabilities: tuple[Capability, ...] = (),
) -> Callable[[Callable[[Flight], None]], Check]:
    """Makes a check from a function: its name is the function's, its description the docstring's first paragraph."""

    def make(run: Callable[[Flight], None]) -> Check:
        needed = set(needs)
        must_fly = starts and all(state in _IN_FLIGHT for state in starts)
        if moves or must_fly:
            needed.add(Need.MOTION)
        description = (run.__doc__ or "").partition("\n\n")[0].strip()
        return Check(
            run.__name__, " ".join(description.split()), run, starts, moves, frozenset(needed), frozenset(capabilities)
        )

    return make
