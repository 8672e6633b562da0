"""The judge's rules for what may change in flight: the autopilot's own fence, and its limits of speed."""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple, Protocol, TypeVar

from tests.campaign.evidence import Breach, Case, estimate_error_m, executed, known_since_s, nearest
from tests.campaign.record import DAEMON_STARTED, Located, Place, Record, Value

FENCE_M = 1.0
"""A fence bounds references: the vehicle may deviate by so much, and by the error of its estimate."""
KNOWN_S = 1.0
"""Seconds after the daemon could know of a bound for which it may still fly by the one before, and then brake."""
_BRAKING_M_S2 = 1.5
_ABOVE_M_S, _ABOVE_RATIO = 0.4, 1.15
"""Excess of speed over the reference, in m/s and as a factor, of a vehicle that makes up for a lag."""
_PACED_S = 1.0
"""Seconds before and after a time for which the simulator's clock is compared with the computer's."""
_ESTIMATED_S = 0.25
_HOME_MOVED_M = 0.3
_CIRCLE = 2
_MOST_M_S = {"px4": "MPC_XY_VEL_MAX", "ardupilot": "WPNAV_SPEED"}
_CRUISE = "MPC_XY_CRUISE"
_PER_UNIT = {"WPNAV_SPEED": 0.01}
_AT_CRUISE = frozenset({"go_to", "go_to_geo", "go_above_home", "path"})


class _Timed(Protocol):
    @property
    def time_s(self) -> float: ...


_T = TypeVar("_T", bound=_Timed)


class Circle(NamedTuple):
    """The autopilot's own fence, as the daemon could know it from a time on; without a radius there is none."""

    time_s: float
    radius_m: float | None
    home: Place | None


class Limit(NamedTuple):
    """The highest ground speed, as the daemon could know it from a time on."""

    time_s: float
    most_m_s: float


def newest(found: Sequence[_T], since_s: float, until_s: float) -> list[_T]:
    """All that held at some time in between."""
    before = [each for each in found if each.time_s <= since_s]
    return before[-1:] + [each for each in found if since_s < each.time_s <= until_s]


def inside_the_newest_fence(case: Case) -> Iterator[Breach]:
    """While the daemon's setpoints fly it, the vehicle is inside the autopilot's own fence that the daemon could know.

    Where it is beyond one that is new, or beyond one when it is commanded, it brakes and leads no farther out.
    """
    record, circles = case.record, autopilot_fences(case.record)
    for each, flown_s in executed(case):
        allowed_s = known_since_s(record, each.time_s, KNOWN_S)
        circle = next(iter(newest(circles, allowed_s, allowed_s)), None)
        if circle is None or circle.radius_m is None or circle.home is None:
            continue
        if len(newest(circles, allowed_s, each.time_s)) > 1:
            continue  # a newer one has just come
        began = at(record.truth, max(circle.time_s, flown_s))
        away_m, reach_m = _away_m(each, circle.home), _away_m(began, circle.home) + braking_m(speed_m_s(began))
        allowed_m = max(circle.radius_m, reach_m) + FENCE_M + estimate_error_m(record, each.time_s)
        if away_m > allowed_m:
            text = f"{away_m:.2f} m from home, its own fence is {circle.radius_m:.1f} m (allowed {allowed_m:.2f})"
            yield Breach("newest fence", each.time_s, text)


def within_the_newest_limits(case: Case) -> Iterator[Breach]:
    """While the daemon's setpoints fly it, the vehicle is no faster than the limit that the daemon could know."""
    record = case.record
    limits = {is_task: _limits(record, is_task=is_task) for is_task in (True, False)}
    tasks = [call for call in record.called if call.name in _AT_CRUISE]
    for each, flown_s in executed(case):
        if each.velocity is None:
            continue
        is_task = any(call.began_s <= each.time_s <= call.ended_s for call in tasks)
        allowed_s = known_since_s(record, each.time_s, KNOWN_S)
        held = newest(limits[is_task], allowed_s, each.time_s)
        if not held or held[0].time_s > allowed_s:
            continue
        most_m_s = max(limit.most_m_s for limit in held)
        began = at(record.truth, max(held[0].time_s, flown_s))
        braking_s = max(0.0, speed_m_s(began) - most_m_s) / _BRAKING_M_S2
        allowed_m_s = most_m_s * _ABOVE_RATIO + _ABOVE_M_S
        if began.time_s > allowed_s - braking_s or speed_m_s(each) <= allowed_m_s:
            continue
        found_m_s = min(speed_m_s(each) * _pace(record.truth, each.time_s), _estimated_m_s(record, each.time_s))
        if found_m_s > allowed_m_s:
            text = f"{found_m_s:.2f} m/s over ground, {most_m_s:.2f} m/s since {held[0].time_s:.2f}"
            yield Breach("limits", each.time_s, f"{text} (allowed {allowed_m_s:.2f})")


def autopilot_fences(record: Record) -> list[Circle]:
    """Each fence that the daemon could know, from when on."""
    found: list[Circle] = []
    for time_s in _received_s(record):
        values = _values(record, time_s)
        homes = newest(record.told_homes, time_s, time_s)
        home = homes[-1].place if homes else None
        now = Circle(time_s, _radius_m(record.autopilot, values), home)
        if not found or _differs(found[-1], now):
            found.append(now)
    return found


def is_near_autopilot_fence(circles: Sequence[Circle], each: Located, near_m: float) -> bool:
    """Returns whether it was nearer than that to the autopilot's own fence, or beyond."""
    circle = next(iter(newest(circles, each.time_s, each.time_s)), None)
    if circle is None or circle.radius_m is None or circle.home is None:
        return False
    return _away_m(each, circle.home) > circle.radius_m - near_m


def _differs(before: Circle, now: Circle) -> bool:
    if before.home is None or now.home is None:
        return before[1:] != now[1:]
    moved_m = math.dist(before.home[:2], now.home[:2])
    return before.radius_m != now.radius_m or moved_m > _HOME_MOVED_M


def _radius_m(autopilot: str, values: dict[str, float]) -> float | None:
    if autopilot == "px4":
        return values.get("GF_MAX_HOR_DIST") or None
    is_on = values.get("FENCE_ENABLE") and int(values.get("FENCE_TYPE", 0.0)) & _CIRCLE
    return values.get("FENCE_RADIUS") if is_on else None


def _limits(record: Record, *, is_task: bool) -> list[Limit]:
    """Each limit that the daemon could know, from when on: of a task's motion, or of any."""
    names = {_MOST_M_S[record.autopilot], *((_CRUISE,) if is_task else ())}
    found: list[Limit] = []
    for time_s in _received_s(record):
        values = _values(record, time_s)
        known = [value * _PER_UNIT.get(name, 1.0) for name, value in values.items() if name in names and value > 0.0]
        most_m_s = min(known, default=math.inf)
        if not found or found[-1].most_m_s != most_m_s:
            found.append(Limit(time_s, most_m_s))
    return found


def _received_s(record: Record) -> list[float]:
    """Returns the times at which something of it became known, or was forgotten."""
    events: list[Value | Located] = [*record.values, *record.told_homes]
    started = [life.time_s for life in record.lives if life.what == DAEMON_STARTED]
    return sorted([each.time_s for each in events] + started)


def _values(record: Record, time_s: float) -> dict[str, float]:
    """The parameters that a daemon could know which has run since its last start."""
    starts = [life.time_s for life in record.lives if life.what == DAEMON_STARTED and life.time_s <= time_s]
    started_s = max(starts, default=-math.inf)
    return {each.name: each.value for each in record.values if started_s <= each.time_s <= time_s}


def at(truth: Sequence[Located], time_s: float) -> Located:
    """Returns the position then, or at the nearest time of which it is known."""
    index = bisect.bisect_left(truth, time_s, key=lambda each: each.time_s)
    return min(truth[max(0, index - 1) : index + 1], key=lambda each: abs(each.time_s - time_s))


def _away_m(each: Located, home: Place) -> float:
    return math.dist(each.place[:2], home[:2])


def speed_m_s(each: Located) -> float:
    return 0.0 if each.velocity is None else math.hypot(*each.velocity[:2])


def _estimated_m_s(record: Record, time_s: float) -> float:
    """Returns the speed over ground by the autopilot's estimated positions: PX4's own estimate is off after a turn."""
    then, now = (nearest(record.estimate, time_s + off_s) for off_s in (-_ESTIMATED_S, _ESTIMATED_S))
    return math.inf if then is None or now is None else math.dist(then[:2], now[:2]) / (2.0 * _ESTIMATED_S)


def _pace(truth: Sequence[Located], time_s: float) -> float:
    """Returns the simulated seconds that passed in one second of the computer, around a time; 1 at most.

    The daemon's references go by the computer's clock, and the truth's velocity by the simulator's, which falls behind
    on a busy computer. Their ratio is that of the way made to the way that the velocities of the truth would have made.
    """
    begin, end = (bisect.bisect_left(truth, time_s + off_s, key=_time_s) for off_s in (-_PACED_S, _PACED_S))
    way_m = would_be_m = 0.0
    for before, after in pairwise(truth[begin:end]):
        way_m += math.dist(before.place[:2], after.place[:2])
        would_be_m += (speed_m_s(before) + speed_m_s(after)) / 2.0 * (after.time_s - before.time_s)
    return min(1.0, way_m / would_be_m) if would_be_m > 0.0 else 1.0


def _time_s(each: Located) -> float:
    return each.time_s


def braking_m(speed_m_s: float) -> float:
    return speed_m_s * KNOWN_S + speed_m_s**2 / (2.0 * _BRAKING_M_S2)
