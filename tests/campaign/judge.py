"""Judges a flight by its record: by the bytes on the wire and the simulator's truth, not by what UAL says of itself.

Each rule is a function from a case to its breaches. The judge knows nothing of the daemon: what may be sent, and
which state is true, is decided anew here from what the autopilot has told the daemon.
"""

from __future__ import annotations

import bisect
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

from tests.campaign.bounds import (
    FENCE_M,
    at,
    braking_m,
    inside_the_newest_fence,
    newest,
    speed_m_s,
    within_the_newest_limits,
)
from tests.campaign.evidence import (
    DISTURBED_S,
    DISTURBING,
    ENTERS,
    FLIES,
    NOTICED_S,
    OWN_S,
    SERVICES,
    STATE_S,
    TASKS,
    TRANSFERS,
    Breach,
    Case,
    Known,
    allowed_from_s,
    begins,
    between,
    estimate_error_m,
    executed,
    is_befallen,
    known_since_s,
    position_text,
    until_s,
)
from tests.campaign.follows import LOW_M, follows, height_m, nothing_flies_unasked, nothing_is_cried_wolf
from tests.campaign.modes import Modes
from tests.campaign.motion import a_task_progresses, a_velocity_leads_straight
from tests.campaign.positions import distance_m
from tests.campaign.record import DAEMON_KILLED, DAEMON_STARTED, Called, Place, Record, StatusText
from tests.campaign.services import (
    a_mission_has_its_owner,
    no_part_of_a_mission_flies,
    what_is_done_was_reached,
    what_is_severe_is_reported,
)
from tests.campaign.words import words_are_true

AHEAD_S = 0.1
"""The daemon may know a little earlier, from a message that is not noted here."""
SILENT_S = 2.0
"""Seconds without any message of the autopilot after which its state is not known."""
REACHED_M = 1.0
"""The tolerance of UAL (0.5 m), and what it may overshoot or wander meanwhile."""
LANDED_M = 0.5
_HOME_S = 3.0
_UNPLACED_S = 2.5
"""The autopilot tells once a second whether it is sure of its position."""
_PAUSE_S = 0.8
_ALONE_S = 10.0
"""Seconds after its daemon was killed for which a vehicle may be elsewhere than the daemon has led it."""
ENDED_S = 1.0
"""By then a task has ended whose vehicle was taken."""
_TAKERS = {
    "pilot": ("safety pilot",),
    "rc_loss": ("rc failsafe",),
    "battery": ("battery failsafe",),
    "fence": ("fence",),
    "wide_fence": ("fence",),
    "station": ("ground station",),
    "ekf": ("position failsafe", "autopilot"),  # without a position UAL ends a task by itself, too
}
_BLINDING = ("ekf",)
ON_GROUND, IN_AIR, TAKEOFF, LANDING = 1, 2, 3, 4


def judge(record: Record) -> list[Breach]:
    """Returns all breaches, in the order of time; the first of each rule and kind speaks for those that follow it."""
    case = Case(record)
    found = [breach for rule in RULES for breach in _first_ones(rule(case))]
    return sorted(found, key=lambda breach: breach.time_s)


def _first_ones(breaches: Iterator[Breach]) -> list[Breach]:
    """Joins what follows within 2 s: a stream of setpoints is one breach."""
    found: list[tuple[Breach, float, int]] = []
    for breach in breaches:
        if found and breach.time_s - found[-1][1] < 2.0:
            first, _, count = found[-1]
            found[-1] = (first, breach.time_s, count + 1)
        else:
            found.append((breach, breach.time_s, 1))
    return [
        first if count == 1 else Breach(first.rule, first.time_s, f"{first.text} ({count} times until {last_s:.2f})")
        for first, last_s, count in found
    ]


# --- The rules --------------------------------------------------------------------------------------------------------


def nothing_after_a_take_over(case: Case) -> Iterator[Breach]:
    """No setpoint while the autopilot flies in a mode that is not ours, unless a command leads out of it."""
    record, modes = case.record, case.modes
    for sent in record.sent:
        if sent.what != "setpoint":
            continue
        since_s = known_since_s(record, sent.time_s, NOTICED_S)
        recent = list(between(case.changes, since_s, sent.time_s))
        if not recent or any(each.mode in (modes.references, None) or not each.armed for each in recent):
            continue
        entering = any(
            call.name in ENTERS and begins(call) and call.began_s <= sent.time_s <= _entered_s(call) + OWN_S
            for call in record.called
        )
        taken = [time_s for time_s in case.taken_s if time_s <= since_s]
        if taken and not any(
            call.name in ENTERS and begins(call) and taken[-1] <= call.began_s <= sent.time_s for call in record.called
        ):
            entering = False
        if not entering:
            yield Breach("take-over", sent.time_s, f"setpoint in mode {recent[-1].mode:#x}, known since {since_s:.2f}")


def _entered_s(call: Called) -> float:
    """Until when a call may lead out of a mode: at the end of a mission UAL takes control back."""
    return until_s(call) if call.name == "mission" else call.ended_s


def nothing_unasked(case: Case) -> Iterator[Breach]:
    """Nothing that flies without a command of ours since the daemon's start, the last take-over, the last disarming."""
    record = case.record
    for sent in record.sent:
        since_s = allowed_from_s(case, sent)
        asked = any(
            call.name in FLIES and begins(call) and since_s <= call.began_s <= sent.time_s for call in record.called
        )
        # A service goes on whatever becomes of the flight.
        is_served = sent.what in TRANSFERS and any(
            call.name in SERVICES and call.began_s <= sent.time_s <= call.ended_s for call in record.called
        )
        if not (asked or is_served):
            mode = "" if sent.mode is None else f" {sent.mode:#x}"
            yield Breach("unasked", sent.time_s, f"{sent.what}{mode} was not asked for since {since_s:.2f}")


def the_state_is_true(case: Case) -> Iterator[Breach]:
    """The state that is told was true at some time within the last 0.5 s."""
    record, changes, modes = case.record, case.changes, case.modes
    times, posed_s = ([each.time_s for each in found] for found in (record.told, record.estimate))
    for said in record.said:
        since_s = known_since_s(record, said.time_s, STATE_S)
        true = {state for each in between(changes, since_s, said.time_s + AHEAD_S) for state in _states(each, modes)}
        true |= _doing(record, since_s, said.time_s)
        if height_m(case, said.time_s) < LOW_M and any(each.armed for each in between(changes, since_s, said.time_s)):
            true.add("LANDED_ARMED")  # it has fallen, and its autopilot has not noticed the ground
        if said.state == "UNINITIALIZED":
            lost = any(each.is_placed is False for each in between(changes, said.time_s - _UNPLACED_S, said.time_s))
            is_silent = _was_silent(times, said.time_s) or _was_silent(posed_s, said.time_s)
            if not (lost or is_silent or _is_disturbed(record, said.time_s)):
                yield _untrue(said, true, "although nothing disturbs it")
        elif _silence_s(times, said.time_s) > SILENT_S and not _was_starved(record, said.time_s):
            yield _untrue(said, {"UNINITIALIZED"}, "although the autopilot is silent")
        elif said.state not in true and not _has_just_begun(record, said.time_s):
            yield _untrue(said, true, "")


def _untrue(said: StatusText, true: set[str], why: str) -> Breach:
    return Breach("state", said.time_s, f"{said.state} is told {why}, not {sorted(true)} ({said.reason})")


def _states(each: Known, modes: Modes) -> set[str]:
    """The states that may be told where this is known of the autopilot, whatever was commanded."""
    if each.armed is None or each.mode is None or each.landed is None:
        return {
            "UNINITIALIZED",
            "LANDED_DISARMED",
            "LANDED_ARMED",
            "FLYING_AUTO",
            "FLYING_MANUAL",
            "TAKING_OFF",
            "LANDING",
        }
    if not each.armed:
        return {"LANDED_DISARMED"}
    found = set()
    if each.landed == ON_GROUND:
        found.add("LANDED_ARMED")
    else:
        found.add("FLYING_AUTO" if each.mode == modes.references else "FLYING_MANUAL")
    if each.mode == modes.mission:  # a client's, or another station's
        found |= {"FLYING_AUTO", "FLYING_MANUAL"}
    if each.mode in modes.takes_off or each.landed == TAKEOFF:
        found.add("TAKING_OFF")
    if each.mode in modes.lands or each.landed == LANDING:
        found.add("LANDING")
    return found


def _doing(record: Record, since_s: float, last_s: float) -> set[str]:
    """The states of what a client has asked the daemon to do."""
    names = {
        call.name for call in record.called if begins(call) and call.began_s <= last_s and until_s(call) >= since_s
    }
    found = {"TAKING_OFF"} if names & {"take_off", "mission"} else set()
    found |= {"LANDING"} if names & {"land", "rtl", "mission"} else set()
    return found | ({"FLYING_AUTO"} if "mission" in names else set())


def _is_disturbed(record: Record, time_s: float) -> bool:
    return _has_just_begun(record, time_s) or any(
        trouble.kind in DISTURBING + _BLINDING and trouble.began_s <= time_s <= trouble.ended_s + DISTURBED_S
        for trouble in record.troubles
    )


def _has_just_begun(record: Record, time_s: float) -> bool:
    """Returns whether the daemon has started within the last seconds: it must hear everything first."""
    return any(life.what == DAEMON_STARTED and 0.0 <= time_s - life.time_s < 5.0 for life in record.lives)


def _was_starved(record: Record, time_s: float) -> bool:
    return known_since_s(record, time_s, STATE_S) < time_s - STATE_S


def _was_silent(times: Sequence[float], time_s: float) -> bool:
    """Returns whether the autopilot itself paused within the last seconds."""
    begin, end = bisect.bisect_left(times, time_s - DISTURBED_S), bisect.bisect_right(times, time_s)
    recent = [*times[max(0, begin - 1) : end], time_s]
    return any(after - before > _PAUSE_S for before, after in pairwise(recent))


def _silence_s(times: Sequence[float], time_s: float) -> float:
    index = bisect.bisect_right(times, time_s)
    return time_s - times[index - 1] if index else 0.0


def who_took_it_is_reported(case: Case) -> Iterator[Breach]:
    """A task ends within a second of the take-over, and names what took the vehicle where only one can have done it."""
    record = case.record
    for taken_s in case.taken_s:
        if known_since_s(record, taken_s + ENDED_S, 0.0) < taken_s + ENDED_S:
            continue  # starved
        names = _takers(record, taken_s)
        for call in record.called:
            if call.name == "mission" and is_befallen(record, _BLINDING, taken_s - DISTURBED_S, taken_s):
                continue  # once the position is known again a failsafe may give it back to the mission
            if call.name not in TASKS or not call.began_s < taken_s - NOTICED_S < taken_s < call.ended_s:
                continue
            if call.ended_s > taken_s + ENDED_S:
                yield Breach("task", taken_s, f"{call.name} went on for {call.ended_s - taken_s:.2f} s")
            elif call.outcome == "TASK_ABORTED" and names and call.by not in names:
                yield Breach("task", call.ended_s, f"{call.name} was ended by {call.by!r}, not by {sorted(names)}")


def _takers(record: Record, time_s: float) -> set[str]:
    """Returns the possible takers of the vehicle, in the words of UAL; empty where the link may have lost the
    reason.
    """
    active = {each.kind for each in record.troubles if each.began_s <= time_s <= each.ended_s + DISTURBED_S}
    return set() if active & set(DISTURBING) else {name for kind in active & set(_TAKERS) for name in _TAKERS[kind]}


def goals_are_reached(case: Case) -> Iterator[Breach]:
    """Yields goals that were reported as reached although the vehicle was not there, by the simulator's truth."""
    for call, missed_m, allowed_m in misses_m(case.record):
        if missed_m > allowed_m:
            text = f"{call.name} to {position_text(call.goal)} was reported as done {missed_m:.2f} m from it"
            yield Breach("goal", call.ended_s, f"{text} (allowed {allowed_m:.2f})")


def misses_m(record: Record) -> Iterator[tuple[Called, float, float]]:
    """Yields the distance of the vehicle from its goal, by the truth, when it was reported as reached; and the allowed
    distance.
    """
    for call in record.called:
        goal = _goal_on_earth(record, call)
        if call.outcome or goal is None:
            continue
        near = [each.place for each in record.truth if abs(each.time_s - call.ended_s) < 0.5]
        if near:
            error_m = 0.0 if call.is_on_earth else record.anchor_error_m
            allowed_m = REACHED_M + error_m + estimate_error_m(record, call.ended_s)
            yield call, min(distance_m(each, goal) for each in near), allowed_m


def _goal_on_earth(record: Record, call: Called) -> Place | None:
    """The goal, from the simulator's start; None where there is none, or where home is not known."""
    if call.goal is not None and call.is_above_home:
        return _above_home(record, call, call.goal)
    if call.goal is None or call.is_on_earth:
        return call.goal
    if record.anchor is None:
        return None
    (east, north, up), (home_east, home_north, home_up) = call.goal, record.anchor
    return (east + home_east, north + home_north, up + home_up)


def _above_home(record: Record, call: Called, goal: Place) -> Place | None:
    """The goal by the autopilot's home, after which it goes; None where that was not known, or moved just then."""
    heights_m = [each.place[2] for each in newest(record.homes, call.ended_s - _HOME_S, call.ended_s)]
    if not heights_m or max(heights_m) - min(heights_m) > LANDED_M:
        return None
    return (goal[0], goal[1], heights_m[-1] + goal[2])


def the_ground_is_reached(case: Case) -> Iterator[Breach]:
    """Yields landings that were reported as done although the vehicle did not stand on the ground."""
    record = case.record
    ground_m = min((each.place[2] for each in record.truth), default=0.0)
    for call in record.called:
        if call.outcome or call.name not in ("land", "rtl"):
            continue
        heights = [each.place[2] for each in record.truth if 0.0 <= each.time_s - call.ended_s < 0.5]
        if heights and min(heights) - ground_m > LANDED_M:
            yield Breach("goal", call.ended_s, f"{call.name} was reported as done {min(heights) - ground_m:.2f} m up")


def inside_the_fence(case: Case) -> Iterator[Breach]:
    """While the daemon's setpoints fly it, the vehicle stays inside the fence.

    Where it is beyond when they begin, as it has flown on without its daemon, it brakes and leads no farther out.
    """
    record = case.record
    if record.fence_m is None:
        return
    for each, flown_s in executed(case):
        beyond_m, began = _beyond_m(record.fence_m, each.place), at(record.truth, flown_s)
        began_m = _beyond_m(record.fence_m, began.place) if _was_left_alone(record, flown_s) else 0.0
        reach_m = began_m + braking_m(speed_m_s(began)) if began_m > 0.0 else 0.0
        allowed_m = FENCE_M + reach_m + estimate_error_m(record, each.time_s)
        if beyond_m > allowed_m:
            text = f"{beyond_m:.2f} m outside at {position_text(each.place)} (allowed {allowed_m:.2f})"
            yield Breach("fence", each.time_s, text)


def _was_left_alone(record: Record, time_s: float) -> bool:
    """Returns whether the daemon before was killed shortly before."""
    return any(life.what == DAEMON_KILLED and 0.0 < time_s - life.time_s < _ALONE_S for life in record.lives)


def _beyond_m(fence_m: tuple[float, float], place: Place) -> float:
    """Returns how far a place is beyond the fence; negative inside."""
    (side_m, height_m), (east, north, up) = fence_m, place
    return max(abs(east) - side_m, abs(north) - side_m, up - height_m)


RULES: tuple[Callable[[Case], Iterator[Breach]], ...] = (
    nothing_after_a_take_over,
    nothing_unasked,
    the_state_is_true,
    who_took_it_is_reported,
    goals_are_reached,
    the_ground_is_reached,
    inside_the_fence,
    inside_the_newest_fence,
    within_the_newest_limits,
    a_task_progresses,
    a_velocity_leads_straight,
    words_are_true,
    follows,
    nothing_is_cried_wolf,
    nothing_flies_unasked,
    a_mission_has_its_owner,
    no_part_of_a_mission_flies,
    what_is_severe_is_reported,
    what_is_done_was_reached,
)
