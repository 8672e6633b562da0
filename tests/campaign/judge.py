"""Judges a flight by its record: by the bytes on the wire and the simulator's truth, not by what UAL says of itself.

Each rule is a function from a case to its breaches. The judge knows nothing of the daemon: what may be sent, and
which state is true, is decided anew here from what the autopilot has told the daemon.
"""

from __future__ import annotations

import bisect
import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from tests.campaign.modes import BY_AUTOPILOT, Modes
from tests.campaign.places import distance_m
from tests.campaign.record import DAEMON_STARTED, Called, Located, Place, Record, Said, Sent, Told

NOTICED_S = 0.1
"""So long after it was told the daemon may still send what was under way."""
STATE_S = 0.5
"""By then the state that is told must be true."""
AHEAD_S = 0.1
"""The daemon may know a little earlier, from a message that is not noted here."""
SILENT_S = 2.0
"""After so long without any word of the autopilot its state is not known."""
OWN_S = 8.0
"""A mode that follows an order of the daemon within this time is its own."""
WAKE_S = 0.3
"""So long a daemon that was stopped, or starved, takes until it has read what has come meanwhile."""
REACHED_M = 1.0
"""The tolerance of UAL (0.5 m), and what it may overshoot or wander meanwhile."""
LANDED_M = 0.5
FENCE_M = 1.0
"""The fence bounds references: the vehicle may deviate by so much, and by the error of its estimate."""
UNKNOWN_M = 0.5
"""The error of an estimate that is not known at a time."""
ENTERS = frozenset({"recover", "land", "rtl", "take_off", "arm"})
"""Commands that may lead out of a mode in which setpoints are not followed."""
FLIES = ENTERS | {"go_to", "go_to_geo", "path", "velocity", "pose", "abort", "disarm"}
REFUSED = frozenset(
    {
        "WRONG_STATE",
        "GEOFENCE",
        "INVALID_ARGUMENT",
        "UNKNOWN_FRAME",
        "PERMISSION_DENIED",
        "UNAUTHENTICATED",
        "FRAME_LOST",
        "NOT_SUPPORTED",
        "RESOURCE_EXHAUSTED",
        "LINK_LOST",
        "UNAVAILABLE",
    }
)
"""So ended, a call has begun nothing. (LINK_LOST and UNAVAILABLE may come in the middle: see `_begins`.)"""
_UNPLACED_S = 2.5
"""The autopilot tells once a second whether it is sure of its position."""
_PAUSE_S = 0.8
_FLOWN_S = 0.5
"""So long after its last setpoint a vehicle is flown by it."""
ENDED_S = 1.0
"""By then a task has ended whose vehicle was taken."""
_TASKS = frozenset({"take_off", "land", "rtl", "go_to", "go_to_geo", "path"})
_TAKERS = {
    "pilot": ("safety pilot",),
    "rc_loss": ("rc failsafe",),
    "battery": ("battery failsafe",),
    "fence": ("fence",),
    "ekf": ("position failsafe", "autopilot"),  # without a position UAL ends a task by itself, too
}
_BLINDING = ("ekf",)
_STARVING = ("freeze", "busy")
_DISTURBING = ("loss", "delay", "corruption", "silence", "freeze", "busy", "reboot", "kill_daemon")
_DISTURBED_S = 6.0
ON_GROUND, IN_AIR, TAKEOFF, LANDING = 1, 2, 3, 4


class Case:
    """A record, and what follows from it for several rules."""

    def __init__(self, record: Record) -> None:
        self.record = record
        self.modes = BY_AUTOPILOT[record.autopilot]
        self.changes = known(record.told)
        """What the autopilot has told."""
        self.taken_s = _take_overs(record, self.changes, self.modes)
        """When something else took the vehicle."""
        self.disarmed_s = [
            after.time_s for before, after in pairwise(self.changes) if before.armed and after.armed is False
        ]
        self.setpoints_s = [sent.time_s for sent in record.sent if sent.what == "setpoint"]


@dataclass(frozen=True)
class Breach:
    """A rule that was broken, when, and how."""

    rule: str
    time_s: float
    text: str


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


# --- What the autopilot has told --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Known:
    """What the daemon could know of the autopilot from a time on."""

    time_s: float
    armed: bool | None
    mode: int | None
    landed: int | None
    is_placed: bool | None = None


def known(told: Sequence[Told]) -> list[Known]:
    """Returns what is known from when on: each message says a part of it."""
    found: list[Known] = []
    armed: bool | None = None
    mode = landed = None
    is_placed: bool | None = None
    for each in told:
        armed = each.armed if each.armed is not None else armed
        mode = each.mode if each.mode is not None else mode
        landed = each.landed if each.landed is not None else landed
        is_placed = each.is_placed if each.is_placed is not None else is_placed
        now = Known(each.time_s, armed, mode, landed, is_placed)
        if not found or dataclasses.replace(now, time_s=found[-1].time_s) != found[-1]:
            found.append(now)
    return found


def _between(changes: Sequence[Known], since_s: float, until_s: float) -> Iterator[Known]:
    """All that held at some time in between."""
    begin = max(0, bisect.bisect_right(changes, since_s, key=lambda each: each.time_s) - 1)
    for each in changes[begin:]:
        if each.time_s > until_s:
            return
        yield each


def _since_s(record: Record, time_s: float, allowed_s: float) -> float:
    """When the daemon must have read what it shows at a time: earlier where it was stopped or starved meanwhile.

    A starvation that lasts is noted in pieces, which follow each other.
    """
    since_s = time_s - allowed_s
    for trouble in sorted(record.troubles, key=lambda each: each.began_s, reverse=True):
        if trouble.kind in _STARVING and trouble.began_s < time_s and trouble.ended_s + WAKE_S > since_s:
            since_s = min(since_s, trouble.began_s - allowed_s)
    return since_s


# --- What was asked ---------------------------------------------------------------------------------------------------


def _begins(call: Called) -> bool:
    """Whether the call may have begun something. One that took a while before the link was lost may have."""
    if call.accepted_count:
        return True
    if call.outcome in ("LINK_LOST", "UNAVAILABLE"):
        return call.ended_s - call.began_s > 0.05
    return call.outcome not in REFUSED


def _own_modes(record: Record, modes: Modes, time_s: float) -> set[int]:
    """The modes into which the daemon's own orders of the last seconds, and its calls under way, may lead."""
    found: set[int] = set()
    for sent in record.sent:
        if time_s - OWN_S < sent.time_s <= time_s:
            if sent.mode is not None:
                found.add(sent.mode)
            if sent.what == "take_off":
                found |= modes.takes_off | {modes.hold}
            if sent.what == "land":
                found |= modes.lands
    if any(call.name == "take_off" and call.began_s <= time_s <= call.ended_s + 1.0 for call in record.called):
        found |= modes.takes_off | {modes.hold}
    return found


def _take_overs(record: Record, changes: Sequence[Known], modes: Modes) -> list[float]:
    """When the daemon was told that something else has taken the armed vehicle out of a mode of ours.

    From one mode of others to another nothing is taken: a failsafe first holds, then returns.
    """
    found = []
    for before, after in pairwise(changes):
        if not after.armed or after.mode is None or before.mode in (None, after.mode):
            continue
        own = _own_modes(record, modes, after.time_s) | {modes.references}
        if before.mode in own and after.mode not in own:
            found.append(after.time_s)
    return found


def _allowed_from_s(case: Case, sent: Sent) -> float:
    """The last time at which whatever allowed the daemon to fly ended: its start, a take-over, the disarming."""
    record = case.record
    ends = [life.time_s for life in record.lives if life.what == DAEMON_STARTED]
    noticed_s, shown_s = _since_s(record, sent.time_s, NOTICED_S), _since_s(record, sent.time_s, STATE_S)
    ends += [time_s for time_s in case.taken_s if time_s < noticed_s]
    ends += [time_s for time_s in case.disarmed_s if time_s < shown_s]
    return max((time_s for time_s in ends if time_s <= sent.time_s), default=-math.inf)


# --- The rules --------------------------------------------------------------------------------------------------------


def nothing_after_a_take_over(case: Case) -> Iterator[Breach]:
    """No setpoint while the autopilot flies in a mode that is not ours, unless a command leads out of it."""
    record, modes = case.record, case.modes
    for sent in record.sent:
        if sent.what != "setpoint":
            continue
        since_s = _since_s(record, sent.time_s, NOTICED_S)
        recent = list(_between(case.changes, since_s, sent.time_s))
        if not recent or any(each.mode in (modes.references, None) or not each.armed for each in recent):
            continue
        entering = any(
            call.name in ENTERS and _begins(call) and call.began_s <= sent.time_s <= call.ended_s + OWN_S
            for call in record.called
        )
        taken = [time_s for time_s in case.taken_s if time_s <= since_s]
        if taken and not any(
            call.name in ENTERS and _begins(call) and taken[-1] <= call.began_s <= sent.time_s for call in record.called
        ):
            entering = False
        if not entering:
            yield Breach("take-over", sent.time_s, f"setpoint in mode {recent[-1].mode:#x}, known since {since_s:.2f}")


def nothing_unasked(case: Case) -> Iterator[Breach]:
    """Nothing that flies without a command of ours since the daemon's start, the last take-over, the last disarming."""
    record = case.record
    for sent in record.sent:
        since_s = _allowed_from_s(case, sent)
        asked = any(
            call.name in FLIES and _begins(call) and since_s <= call.began_s <= sent.time_s for call in record.called
        )
        if not asked:
            mode = "" if sent.mode is None else f" {sent.mode:#x}"
            yield Breach("unasked", sent.time_s, f"{sent.what}{mode} was not asked for since {since_s:.2f}")


def the_state_is_true(case: Case) -> Iterator[Breach]:
    """The state that is told was true at some time within the last 0.5 s."""
    record, changes, modes = case.record, case.changes, case.modes
    times = [each.time_s for each in record.told]
    for said in record.said:
        since_s = _since_s(record, said.time_s, STATE_S)
        true = {state for each in _between(changes, since_s, said.time_s + AHEAD_S) for state in _states(each, modes)}
        true |= _doing(record, since_s, said.time_s)
        if said.state == "UNINITIALIZED":
            lost = any(each.is_placed is False for each in _between(changes, said.time_s - _UNPLACED_S, said.time_s))
            if not (lost or _is_disturbed(record, said.time_s) or _was_silent(times, said.time_s)):
                yield _untrue(said, true, "although nothing disturbs it")
        elif _silence_s(times, said.time_s) > SILENT_S and not _was_starved(record, said.time_s):
            yield _untrue(said, {"UNINITIALIZED"}, "although the autopilot is silent")
        elif said.state not in true and not _has_just_begun(record, said.time_s):
            yield _untrue(said, true, "")


def _untrue(said: Said, true: set[str], why: str) -> Breach:
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
    if each.mode in modes.takes_off or each.landed == TAKEOFF:
        found.add("TAKING_OFF")
    if each.mode in modes.lands or each.landed == LANDING:
        found.add("LANDING")
    return found


def _doing(record: Record, since_s: float, until_s: float) -> set[str]:
    """The states of what a client has asked the daemon to do."""
    names = {
        call.name
        for call in record.called
        if _begins(call) and call.began_s <= until_s and (call.ended_s >= since_s or call.outcome == "CLIENT_KILLED")
    }
    return ({"TAKING_OFF"} if "take_off" in names else set()) | ({"LANDING"} if names & {"land", "rtl"} else set())


def _is_disturbed(record: Record, time_s: float) -> bool:
    return _has_just_begun(record, time_s) or any(
        trouble.kind in _DISTURBING + _BLINDING and trouble.began_s <= time_s <= trouble.ended_s + _DISTURBED_S
        for trouble in record.troubles
    )


def _has_just_begun(record: Record, time_s: float) -> bool:
    """Whether the daemon has started within the last seconds: it must hear everything first."""
    return any(life.what == DAEMON_STARTED and 0.0 <= time_s - life.time_s < 5.0 for life in record.lives)


def _was_starved(record: Record, time_s: float) -> bool:
    return _since_s(record, time_s, STATE_S) < time_s - STATE_S


def _was_silent(times: Sequence[float], time_s: float) -> bool:
    """Whether the autopilot itself paused within the last seconds."""
    begin, end = bisect.bisect_left(times, time_s - _DISTURBED_S), bisect.bisect_right(times, time_s)
    recent = [*times[max(0, begin - 1) : end], time_s]
    return any(after - before > _PAUSE_S for before, after in pairwise(recent))


def _silence_s(times: Sequence[float], time_s: float) -> float:
    index = bisect.bisect_right(times, time_s)
    return time_s - times[index - 1] if index else 0.0


def who_took_it_is_told(case: Case) -> Iterator[Breach]:
    """A task ends within a second of the take-over, and names who took the vehicle where only one can have done it."""
    record = case.record
    for taken_s in case.taken_s:
        if _since_s(record, taken_s + ENDED_S, 0.0) < taken_s + ENDED_S:
            continue  # starved
        names = _takers(record, taken_s)
        for call in record.called:
            if call.name not in _TASKS or not call.began_s < taken_s - NOTICED_S < taken_s < call.ended_s:
                continue
            if call.ended_s > taken_s + ENDED_S:
                yield Breach("task", taken_s, f"{call.name} went on for {call.ended_s - taken_s:.2f} s")
            elif call.outcome == "TASK_ABORTED" and names and call.by not in names:
                yield Breach("task", call.ended_s, f"{call.name} was ended by {call.by!r}, not by {sorted(names)}")


def _takers(record: Record, time_s: float) -> set[str]:
    """Who or what can have taken the vehicle, in the words of UAL; empty where the link may have lost the reason."""
    active = {each.kind for each in record.troubles if each.began_s <= time_s <= each.ended_s + _DISTURBED_S}
    return set() if active & set(_DISTURBING) else {name for kind in active & set(_TAKERS) for name in _TAKERS[kind]}


def goals_are_reached(case: Case) -> Iterator[Breach]:
    """Where a goal was reported as reached the vehicle was there, by the simulator's truth."""
    for call, missed_m, allowed_m in misses_m(case.record):
        if missed_m > allowed_m:
            text = f"{call.name} to {_text(call.goal)} was reported as done {missed_m:.2f} m from it"
            yield Breach("goal", call.ended_s, f"{text} (allowed {allowed_m:.2f})")


def misses_m(record: Record) -> Iterator[tuple[Called, float, float]]:
    """How far from its goal the vehicle was, by the truth, when it was reported as reached; and how far it may be."""
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
    if call.goal is None or call.is_on_earth:
        return call.goal
    if record.anchor is None:
        return None
    (east, north, up), (home_east, home_north, home_up) = call.goal, record.anchor
    return (east + home_east, north + home_north, up + home_up)


def the_ground_is_reached(case: Case) -> Iterator[Breach]:
    """Where a landing was reported as done the vehicle stood on the ground."""
    record = case.record
    ground_m = min((each.place[2] for each in record.truth), default=0.0)
    for call in record.called:
        if call.outcome or call.name not in ("land", "rtl"):
            continue
        heights = [each.place[2] for each in record.truth if 0.0 <= each.time_s - call.ended_s < 0.5]
        if heights and min(heights) - ground_m > LANDED_M:
            yield Breach("goal", call.ended_s, f"{call.name} was reported as done {min(heights) - ground_m:.2f} m up")


def inside_the_fence(case: Case) -> Iterator[Breach]:
    """While the daemon's setpoints fly it, the vehicle stays inside the fence."""
    record, times = case.record, case.setpoints_s
    if record.fence_m is None:
        return
    side_m, height_m = record.fence_m
    for each in record.truth:
        index = bisect.bisect_right(times, each.time_s)
        if not index or each.time_s - times[index - 1] > _FLOWN_S:
            continue
        east, north, up = each.place
        beyond_m = max(abs(east) - side_m, abs(north) - side_m, up - height_m)
        allowed_m = FENCE_M + estimate_error_m(record, each.time_s)
        if beyond_m > allowed_m:
            text = f"{beyond_m:.2f} m outside at {_text(each.place)} (allowed {allowed_m:.2f})"
            yield Breach("fence", each.time_s, text)


def estimate_error_m(record: Record, time_s: float) -> float:
    """How wrong the autopilot's own estimate was: UAL can be no better."""
    estimate, truth = _nearest(record.estimate, time_s), _nearest(record.truth, time_s)
    return UNKNOWN_M if estimate is None or truth is None else distance_m(estimate, truth)


def _nearest(found: Sequence[Located], time_s: float) -> Place | None:
    index = bisect.bisect_left(found, time_s, key=lambda each: each.time_s)
    near = [each for each in found[max(0, index - 1) : index + 1] if abs(each.time_s - time_s) < 0.5]
    return min(near, key=lambda each: abs(each.time_s - time_s)).place if near else None


def _text(place: Place | None) -> str:
    return "nowhere" if place is None else "(" + ", ".join(f"{value:.1f}" for value in place) + ")"


RULES: tuple[Callable[[Case], Iterator[Breach]], ...] = (
    nothing_after_a_take_over,
    nothing_unasked,
    the_state_is_true,
    who_took_it_is_told,
    goals_are_reached,
    the_ground_is_reached,
    inside_the_fence,
)
