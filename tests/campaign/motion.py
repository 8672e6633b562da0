"""The judge's rules for how it is flown: a task makes way, and a velocity leads along its line."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from tests.campaign.bounds import autopilot_fences, is_near_autopilot_fence
from tests.campaign.evidence import DISTURBING, Breach, Case, between, is_befallen, nearest
from tests.campaign.positions import distance_m
from tests.campaign.record import Called, Located, Place, Record

STILL_S = 13.0
"""A task ends that has made no way for 10 s; it may take a while to begin, and to notice."""
STILL_M = 0.5
ASIDE_M = {"px4": 0.4, "ardupilot": 0.3}
"""Metres beside its line, in which an autopilot that holds its position still moves."""
LONG_S = 3.0
"""A velocity that is flown for so long out of a held position is judged."""
_HELD_M_S = 0.3
_SLOWEST_M_S = 0.2
_NEAR_M = 3.0
"""Nearer to a fence it is stopped, and held."""
_UP_M = 0.5
_MOVING = frozenset({"take_off", "rtl", "go_to", "go_to_geo", "go_above_home", "path"})
_INTERRUPTING = (*DISTURBING, "second_sender", "ekf")
_STARVING = "busy"
_PAUSED_S = 0.5
"""After longer without a new velocity it stops."""
_LEADING_ASIDE = (
    *(kind for kind in _INTERRUPTING if kind != _STARVING),
    "pilot",
    "rc_loss",
    "battery",
    "fence",
    "station",
)


def a_task_progresses(case: Case) -> Iterator[Breach]:
    """No task goes on whose vehicle has stood for 13 s by the truth and by the estimate, whatever its cause.

    A barometer that drifted brought an ArduCopter to the ground whose estimate went on sinking to its goal for 60 s.
    """
    record = case.record
    ground_m = min((each.place[2] for each in record.truth), default=0.0)
    for call in record.called:
        if call.name not in _MOVING:
            continue
        places = [each for each in record.truth if call.began_s <= each.time_s <= call.ended_s]
        stood = _stood(record, places)
        if stood is None:
            continue
        if call.name != "rtl" or stood.place[2] - ground_m > _UP_M:
            text = f"{call.name} went on although it had stood at {stood.place} for {STILL_S:.0f} s"
            yield Breach("way", stood.time_s + STILL_S, text)


def _stood(record: Record, places: Sequence[Located]) -> Located | None:
    """From where on it did not move for so long, though nothing interrupted it; None if it always did."""
    begin = places[0] if places else None
    for each in places:
        assert begin is not None
        is_interrupted = is_befallen(record, _INTERRUPTING, each.time_s, each.time_s)
        if is_interrupted or distance_m(each.place, begin.place) > STILL_M or _seems_moved(record, begin, each):
            begin = each
        elif each.time_s - begin.time_s > STILL_S:
            return begin
    return None


def _seems_moved(record: Record, begin: Located, end: Located) -> bool:
    before, after = nearest(record.estimate, begin.time_s), nearest(record.estimate, end.time_s)
    return before is not None and after is not None and distance_m(before, after) > STILL_M


def a_velocity_leads_straight(case: Case) -> Iterator[Breach]:
    """A velocity that is flown out of a held position leads along its line; the estimate's own error is allowed."""
    for call, worst_m, allowed_m in asides_m(case):
        if worst_m > allowed_m:
            text = f"a velocity of {call.velocity} led {worst_m:.2f} m beside its line (allowed {allowed_m:.2f})"
            yield Breach("aside", call.ended_s, text)


def asides_m(case: Case) -> Iterator[tuple[Called, float, float]]:
    """Yields the largest and the allowed distance from the line of each velocity."""
    record = case.record
    for call in record.called:
        places = list(_on_path(case, call))
        if not places or places[-1].time_s - places[0].time_s < LONG_S:
            continue
        begin = places[0]
        led_m = _led_aside_m(record, call)
        off = [_beyond_m(_aside_m(call, begin.place, each.place), led_m) for each in places]
        errors = [_error_m(record, call, begin, each) for each in places]
        allowed = [ASIDE_M[record.autopilot] + abs(error) for error in errors]
        worst = max(range(len(off)), key=lambda number: abs(off[number]) - allowed[number])
        yield call, abs(off[worst]), allowed[worst]


def _on_path(case: Case, call: Called) -> Iterator[Located]:
    """Yields positions while the velocity flew it, far from fences; none where something else may have led it aside."""
    record = case.record
    if call.velocity is None or math.hypot(*call.velocity[:2]) < _SLOWEST_M_S:
        return
    if is_befallen(record, _LEADING_ASIDE, call.began_s - LONG_S, call.ended_s) or _starved_s(record, call) > _PAUSED_S:
        return
    if any(each.mode != case.modes.references for each in between(case.changes, call.began_s, call.ended_s)):
        return
    places = [each for each in record.truth if call.began_s <= each.time_s <= call.ended_s]
    if not places or places[0].velocity is None or math.hypot(*places[0].velocity) > _HELD_M_S:
        return
    circles = autopilot_fences(record)
    for each in places:
        if _is_near_a_fence(record, each.place) or is_near_autopilot_fence(circles, each, _NEAR_M):
            return
        yield each


def _starved_s(record: Record, call: Called) -> float:
    """For how long the computer did not run what flies it, meanwhile."""
    starvations = [each for each in record.troubles if each.kind == _STARVING]
    times = [(max(each.began_s, call.began_s), min(each.ended_s, call.ended_s)) for each in starvations]
    return sum(max(0.0, until_s - since_s) for since_s, until_s in times)


def _is_near_a_fence(record: Record, place: Place) -> bool:
    if record.fence_m is None:
        return False
    return max(abs(place[0]), abs(place[1])) > record.fence_m[0] - _NEAR_M


def _led_aside_m(record: Record, call: Called) -> float:
    """Returns how far to the left, in m, the position lay that was held before: the velocity begins with it."""
    ways = [sent.way for sent in record.sent if call.began_s - _PAUSED_S <= sent.time_s <= call.began_s and sent.way]
    return _aside_m(call, (0.0, 0.0, 0.0), ways[-1]) if ways else 0.0


def _beyond_m(aside_m: float, led_m: float) -> float:
    """Returns how far it is beside what lies between the line from where it was, and that from where it was led."""
    return aside_m - min(max(aside_m, min(0.0, led_m)), max(0.0, led_m))


def _aside_m(call: Called, begin: Place, place: Place) -> float:
    """Returns the distance to the left of the line from `begin`."""
    assert call.velocity is not None
    east, north, _ = call.velocity
    return (east * (place[1] - begin[1]) - north * (place[0] - begin[0])) / math.hypot(east, north)


def _error_m(record: Record, call: Called, begin: Located, each: Located) -> float:
    """Returns the drift of the autopilot's own estimate to the side since then."""
    then, now = nearest(record.estimate, begin.time_s), nearest(record.estimate, each.time_s)
    if then is None or now is None:
        return math.inf
    return _aside_m(call, then, now) - _aside_m(call, begin.place, each.place)
