"""Plan of one flight and of its faults: all of it follows from the seed."""

from __future__ import annotations

import math
import random
from collections.abc import Collection
from dataclasses import dataclass

OURS, FOREIGN = "ours", "foreign"
AREA_M, FENCE_SIDE_M, FENCE_HEIGHT_M = 5.0, 12.0, 15.0
HEIGHT_M = 3.0
_FAR_M, _ASIDE_M = 9.0, 4.0
_LOWEST_M, _HIGHEST_M = 2.5, 5.0
_MOTIONS = (
    "go_to",
    "go_to",
    "go_to_geo",
    "go_above_home",
    "path",
    "across",
    "across",
    "velocity",
    "line",
    "line",
    "pose",
    "outside",
    "push",
    "abort",
    "mission",
    "mission",
    "mission",
    "mission",
)
PLAIN, PAUSE, JUMP, ABORT, AGAIN = range(5)
"""Requests to a mission on its way: nothing, a pause, a jump to its last item, an abort, its start once more."""
_SERVICES = ("parameters", "fence", "logs", "camera")
_KINDS = {
    "loss": 4,
    "delay": 4,
    "corruption": 4,
    "silence": 5,
    "reboot": 2,
    "kill_daemon": 5,
    "kill_client": 4,
    "second_sender": 4,
    "pilot": 8,
    "rc_loss": 3,
    "battery": 2,
    "fence": 2,
    "ekf": 2,
    "limits": 5,
    "wide_fence": 5,
    "home": 5,
    "origin": 4,
    "station": 3,
    "freeze": 5,
    "busy": 3,
    "motor_off": 5,
    "motor_weak": 4,
    "stop": 6,
    "disarmed": 6,
    "held": 4,
    "gps_jam": 2,
    "gps_jump": 2,
    "compass": 2,
    "barometer": 2,
    "accelerometer": 2,
    "wind": 3,
    "station_parameter": 2,
    "station_reboot": 1,
}
"""Relative frequency of each kind of fault."""
_GROUND_ONLY = frozenset({"reboot"})
_IN_FLIGHT = frozenset({"pilot", "fence", "ekf"})
_IN_MOTION = frozenset({"limits", "wide_fence", "home", "origin", "station"})
_OF_VEHICLE = frozenset(
    (
        "motor_off",
        "motor_weak",
        "stop",
        "disarmed",
        "gps_jam",
        "gps_jump",
        "compass",
        "barometer",
        "accelerometer",
        "wind",
    )
)
_OF_MISSION = ("station_upload", "station_clear", "station_jump", "cut")
_WITH_MISSION = 25
"""Relative frequency of each kind, in a flight that has a mission."""
_BY_STATION = frozenset({"station_parameter", "station_reboot"})
_FOREIGN = 0.08
_NO_FAULT = 0.1
_ARMED_BY_CLIENT = 0.3
_BY_RTL = 0.1
_BY_SERVICE = 0.25


@dataclass(frozen=True)
class Step:
    """One command of the mission, with its numbers."""

    name: str
    values: tuple[float, ...] = ()


@dataclass(frozen=True)
class Fault:
    """Fault of the flight, `delay_s` after the step of this number begins. `strength` is 0 to 1."""

    kind: str
    step: int
    delay_s: float
    duration_s: float
    strength: float


@dataclass(frozen=True)
class Plan:
    """One flight."""

    seed: int
    mission: str
    armed_by: str
    steps: tuple[Step, ...]
    faults: tuple[Fault, ...]


def plan(seed: int, *, has_faults: bool = True) -> Plan:
    """Returns the flight of a seed. Without faults it is the same mission."""
    dice = random.Random(seed)
    mission = FOREIGN if dice.random() < _FOREIGN else OURS
    armed_by = "client" if dice.random() < _ARMED_BY_CLIENT else "pilot"
    steps = [Step("arm"), Step("take_off", (HEIGHT_M,))]
    steps += [step for _ in range(dice.choice((1, 2, 2))) for step in _motions(dice)]
    steps.append(Step("rtl", (4.0,)) if dice.random() < _BY_RTL else Step("land"))
    if dice.random() < _BY_SERVICE:
        steps.insert(dice.randint(2, len(steps) - 1), Step(dice.choice(_SERVICES)))
    count = 0 if dice.random() < _NO_FAULT else dice.choice((1, 1, 2))
    faults = tuple(_fault(dice, steps) for _ in range(count))
    return Plan(seed, mission, armed_by, tuple(steps), faults if has_faults else ())


def has(flight: Plan, words: Collection[str]) -> bool:
    """Returns whether a flight has each of these steps and faults, by their names."""
    return {each.name for each in flight.steps} | {each.kind for each in flight.faults} >= set(words)


def _motions(dice: random.Random) -> tuple[Step, ...]:
    name = dice.choice(_MOTIONS)
    if name == "mission":
        return _mission(dice)
    return _row(dice) if name == "line" else (_motion(dice, name),)


def _mission(dice: random.Random) -> tuple[Step, ...]:
    """Brings a mission, and has it flown; something may be asked of it on its way."""
    places = tuple(value for _ in range(dice.choice((2, 3, 4))) for value in _position(dice))
    action = float(dice.choice((PLAIN, PLAIN, PAUSE, JUMP, ABORT, AGAIN)))
    return Step("upload", places), Step("mission", (action, dice.uniform(0.2, 4.0)))


def _row(dice: random.Random) -> tuple[Step, ...]:
    """A velocity out of a hold, from one side of home to the other."""
    direction_rad, speed_m_s = dice.uniform(-math.pi, math.pi), dice.uniform(0.5, 1.5)
    east, north = math.cos(direction_rad), math.sin(direction_rad)
    velocity = (speed_m_s * east, speed_m_s * north, 0.0, dice.uniform(4.0, 8.0))
    return Step("go_to", (-_ASIDE_M * east, -_ASIDE_M * north, HEIGHT_M)), Step("velocity", velocity)


def _motion(dice: random.Random, name: str) -> Step:
    if name == "path":
        return Step(name, tuple(value for _ in range(2) for value in _position(dice)))
    if name == "across":
        side, north_m = dice.choice((-1, 1)), dice.uniform(-_FAR_M / 2.0, _FAR_M / 2.0)
        return Step("path", (side * _FAR_M, north_m, HEIGHT_M, -side * _FAR_M, -north_m, HEIGHT_M))
    if name == "velocity":
        direction_rad = dice.uniform(-math.pi, math.pi)
        speed_m_s = dice.uniform(0.3, 1.5)
        east, north = speed_m_s * math.cos(direction_rad), speed_m_s * math.sin(direction_rad)
        return Step(name, (east, north, 0.0, dice.uniform(1.0, 2.5)))
    if name == "push":
        direction_rad = dice.choice((0, 1, 2, 3)) * math.pi / 2
        return Step("velocity", (5.0 * math.cos(direction_rad), 5.0 * math.sin(direction_rad), 0.0, 4.0))
    if name == "outside":
        return Step("go_to", (dice.choice((-1, 1)) * dice.uniform(20.0, 60.0), 0.0, HEIGHT_M))
    if name == "abort":
        return Step(name, (float(dice.random() < 0.5),))
    return Step(name, _position(dice))


def _position(dice: random.Random) -> tuple[float, float, float]:
    return (
        dice.uniform(-AREA_M, AREA_M),
        dice.uniform(-AREA_M, AREA_M),
        dice.uniform(_LOWEST_M, _HIGHEST_M),
    )


def _fault(dice: random.Random, steps: list[Step]) -> Fault:
    missions = [number for number, step in enumerate(steps) if step.name == "mission"]
    kinds = _KINDS | dict.fromkeys(_OF_MISSION, _WITH_MISSION if missions else 0)
    kind = dice.choices(list(kinds), list(kinds.values()))[0]
    durations = {"silence": (0.3, 4.0), "freeze": (0.1, 3.0), "kill_daemon": (0.0, 3.0), "busy": (1.0, 2.0)}
    duration_s, strength = dice.uniform(*durations.get(kind, (1.5, 4.0))), dice.random()
    if kind in _OF_MISSION:
        if kind == "cut":
            return Fault(kind, [step.name for step in steps].index("upload"), 0.0, duration_s, strength)
        return Fault(kind, missions[0], dice.uniform(1.5, 5.0), duration_s, strength)
    if kind == "held":
        return Fault(kind, 0, 0.0, duration_s, strength)
    first = 2 if kind in _IN_MOTION else 1 if kind in _IN_FLIGHT | _OF_VEHICLE | _BY_STATION else 0
    last = 0 if kind in _GROUND_ONLY else len(steps) - 2 if kind in _IN_MOTION else len(steps) - 1
    return Fault(kind, dice.randint(first, last), dice.uniform(0.0, 2.5), duration_s, strength)
