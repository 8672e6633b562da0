"""Record of a flight: bytes on the wire, reports of the daemon, calls, faults, the truth.

All times are seconds of the computer's monotonic clock; places are metres east, north and up of the simulator's start.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, fields
from typing import Any

Place = tuple[float, float, float]

DAEMON_STARTED, DAEMON_KILLED = "started", "killed"


@dataclass(frozen=True)
class ReportedSample:
    """Message from the autopilot to the daemon; None: this message does not contain it."""

    time_s: float
    armed: bool | None = None
    mode: int | None = None
    landed: int | None = None
    is_placed: bool | None = None
    """Whether the autopilot's estimator is sure of its position."""


@dataclass(frozen=True)
class Sent:
    """Message of the daemon that may move or change the vehicle: ``setpoint``, ``mode``, ``arm``, ``take_off``, …"""

    time_s: float
    what: str
    mode: int | None = None
    way: Place | None = None
    """Of a setpoint with a position: from where the autopilot takes itself to be to there, metres east, north, up."""
    velocity: Place | None = None
    """Of a setpoint with a velocity: m/s east, north and up."""


@dataclass(frozen=True)
class StatusText:
    """The state that the daemon told a subscriber."""

    time_s: float
    state: str
    reason: str = ""


@dataclass(frozen=True)
class Called:
    """A call of a client. `outcome` is empty where it was done, else the reason of the error. `goal` is a place on
    Earth where `is_on_earth`, else in ``<ns>/odom``.
    """

    name: str
    began_s: float
    ended_s: float
    outcome: str = ""
    by: str = ""
    goal: Place | None = None
    is_on_earth: bool = False
    accepted_count: int = 0
    """Of a stream: the setpoints before its end that were accepted."""
    velocity: Place | None = None
    """Of a velocity: m/s east, north and up."""
    is_above_home: bool = False
    """Whether `goal` has its height above the autopilot's home."""
    text: str = ""
    """Text of the error."""
    height_m: float | None = None
    """Of a take-off: what was asked."""
    goals: tuple[Place, ...] = ()
    """Of a mission: its places, in their order, by the simulator's start; those that were jumped over are not there."""


@dataclass(frozen=True)
class Located:
    """Position of the vehicle: by the simulator's truth, or by the autopilot's estimate."""

    time_s: float
    place: Place
    velocity: Place | None = None
    """By the truth: m/s east, north and up."""


@dataclass(frozen=True)
class Value:
    """A parameter of the autopilot, as it reached the daemon."""

    time_s: float
    name: str
    value: float


@dataclass(frozen=True)
class Text:
    """A text of the autopilot as it reached the daemon, or one of the health that was told, as a whole."""

    time_s: float
    text: str


@dataclass(frozen=True)
class Order:
    """An act of the safety pilot or a ground station: ``arm``, ``upload``, ``clear``, ..."""

    time_s: float
    what: str


@dataclass(frozen=True)
class Trouble:
    """A fault, from its begin to its end."""

    kind: str
    began_s: float
    ended_s: float


@dataclass(frozen=True)
class Life:
    """The daemon was started or killed."""

    time_s: float
    what: str


@dataclass
class Record:
    """One flight, from before its arming to after its end. `fence_m` is half the side of the square fence and its
    height.
    """

    autopilot: str
    fence_m: tuple[float, float] | None = None
    anchor: Place | None = None
    """Position of home by the truth when it was last set before this flight, and the error of the estimate then."""
    anchor_error_m: float = 0.0
    told: list[ReportedSample] = field(default_factory=list)
    sent: list[Sent] = field(default_factory=list)
    said: list[StatusText] = field(default_factory=list)
    called: list[Called] = field(default_factory=list)
    truth: list[Located] = field(default_factory=list)
    estimate: list[Located] = field(default_factory=list)
    troubles: list[Trouble] = field(default_factory=list)
    lives: list[Life] = field(default_factory=list)
    values: list[Value] = field(default_factory=list)
    told_homes: list[Located] = field(default_factory=list)
    """Positions of the autopilot's home, as they reached the daemon."""
    homes: list[Located] = field(default_factory=list)
    """Positions of home, as the autopilot reported them on another link, several times a second."""
    texts: list[Text] = field(default_factory=list)
    """Texts of severity 0 to 2."""
    healths: list[Text] = field(default_factory=list)
    """The failing checks that a subscriber was told, and the failsafe, when they changed."""
    missions: list[Value] = field(default_factory=list)
    """The autopilot's words of its mission as they reached the daemon: its checksum, or its number of items."""
    uploaded: list[Value] = field(default_factory=list)
    """Times at which the autopilot told the daemon that a mission had come as a whole, or was removed."""
    orders: list[Order] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)
    """The faults that did not come about, and why."""

    def to_json(self) -> str:
        """Returns it as text, to be judged again later."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> Record:
        """Returns what `to_json` has written."""
        values: dict[str, Any] = json.loads(text)
        for name, kind in _KINDS.items():
            values[name] = [kind(**_tuples(each)) for each in values.get(name, ())]
        for name in ("fence_m", "anchor"):
            values[name] = None if values[name] is None else tuple(values[name])
        return cls(**values)


_KINDS: dict[str, type] = {
    "told": ReportedSample,
    "sent": Sent,
    "said": StatusText,
    "called": Called,
    "truth": Located,
    "estimate": Located,
    "troubles": Trouble,
    "lives": Life,
    "values": Value,
    "told_homes": Located,
    "homes": Located,
    "texts": Text,
    "healths": Text,
    "orders": Order,
    "missions": Value,
    "uploaded": Value,
}
assert set(_KINDS) <= {each.name for each in fields(Record)}


def _tuples(values: dict[str, Any]) -> dict[str, Any]:
    return {name: _tuple(value) for name, value in values.items()}


def _tuple(value: Any) -> Any:
    return tuple(map(_tuple, value)) if isinstance(value, list) else value
