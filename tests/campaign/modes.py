"""The modes of each autopilot, as numbers on the wire, in the judge's own words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


def _px4(main: int, sub: int = 0) -> int:
    return main << 16 | sub << 24


def _ardupilot(main: int, _: int = 0) -> int:
    return main


@dataclass(frozen=True)
class Modes:
    """`references` is where setpoints are followed; `takes_off` and `lands` are the autopilot's own modes for that,
    `hold` is where it goes by itself after its own take-off. `mission` is where it flies its mission.
    """

    references: int
    takes_off: frozenset[int]
    lands: frozenset[int]
    returns: int
    hold: int
    mission: int
    number: Callable[[int, int], int]
    """From the two numbers of DO_SET_MODE."""


PX4 = Modes(
    references=_px4(6),
    takes_off=frozenset({_px4(4, 2)}),
    lands=frozenset({_px4(4, 6)}),
    returns=_px4(4, 5),
    hold=_px4(4, 3),
    mission=_px4(4, 4),
    number=_px4,
)
ARDUPILOT = Modes(
    references=4, takes_off=frozenset(), lands=frozenset({9}), returns=6, hold=17, mission=3, number=_ardupilot
)
BY_AUTOPILOT = {"px4": PX4, "ardupilot": ARDUPILOT}
