"""Evidence from the record of a flight for several rules: known, requested and taken values, and their errors."""

from __future__ import annotations

import bisect
import dataclasses
import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from tests.campaign.modes import BY_AUTOPILOT, Modes
from tests.campaign.positions import distance_m
from tests.campaign.record import DAEMON_KILLED, DAEMON_STARTED, Called, Located, Place, Record, ReportedSample, Sent

NOTICED_S = 0.1
"""Seconds after a report within which the daemon may still send messages that were under way."""
STATE_S = 0.5
"""By then the state that is told must be true."""
OWN_S = 8.0
"""A mode that follows an order of the daemon within this time is its own."""
WAKE_S = 0.3
"""Seconds after which a daemon that was stopped, or starved, has read the messages of the meantime."""
UNKNOWN_M = 0.5
"""The error of an estimate that is not known at a time."""
ENTERS = frozenset({"recover", "land", "rtl", "take_off", "arm", "mission"})
"""Commands that may lead out of a mode in which setpoints are not followed."""
SERVICES = frozenset({"upload", "parameters", "fence", "logs", "camera"})
TRANSFERS = frozenset({"mission_count", "mission_item_int", "mission_clear_all", "param_set", "file_transfer_protocol"})
"""Messages of a service, which move nothing."""
FLIES = ENTERS | SERVICES | {"go_to", "go_to_geo", "go_above_home", "path", "velocity", "pose", "abort", "disarm"}
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
"""So ended, a call has begun nothing. (LINK_LOST and UNAVAILABLE may come in the middle: see `begins`.)"""
FLOWN_S = 0.5
"""Seconds after its last setpoint for which a vehicle is flown by it."""
TASKS = frozenset({"take_off", "land", "rtl", "go_to", "go_to_geo", "go_above_home", "path", "mission"})
_GOING_ON = ("CLIENT_KILLED", "TIMEOUT")
"""So ended, a task goes on: its client has only stopped waiting for it."""
_STARVING = ("freeze", "busy")
DISTURBING = ("loss", "delay", "corruption", "silence", "cut", "freeze", "busy", "reboot", "kill_daemon")
DISTURBED_S = 6.0


class Case:
    """A record, and what follows from it for several rules."""

    def __init__(self, record: Record) -> None:
        self.record = record
        self.modes = BY_AUTOPILOT[record.autopilot]
        self.changes = known(record.told)
        """Reports of the autopilot."""
        self.taken_s = _take_overs(record, self.changes, self.modes)
        """Times at which something else took the vehicle."""
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


# --- What the autopilot has told --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Known:
    """Knowledge that the daemon could have of the autopilot from a time on."""

    time_s: float
    armed: bool | None
    mode: int | None
    landed: int | None
    is_placed: bool | None = None


def known(told: Sequence[ReportedSample]) -> list[Known]:
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


def between(changes: Sequence[Known], since_s: float, until_s: float) -> Iterator[Known]:
    """All that held at some time in between."""
    begin = max(0, bisect.bisect_right(changes, since_s, key=lambda each: each.time_s) - 1)
    for each in changes[begin:]:
        if each.time_s > until_s:
            return
        yield each


def known_since_s(record: Record, time_s: float, allowed_s: float) -> float:
    """Returns the time of the data that the daemon shows at a time: earlier where it was stopped or starved meanwhile.

    A starvation that lasts is noted in pieces, which follow each other.
    """
    since_s = time_s - allowed_s
    for trouble in sorted(record.troubles, key=lambda each: each.began_s, reverse=True):
        if trouble.kind in _STARVING and trouble.began_s < time_s and trouble.ended_s + WAKE_S > since_s:
            since_s = min(since_s, trouble.began_s - allowed_s)
    return since_s


# --- What was asked ---------------------------------------------------------------------------------------------------


def begins(call: Called) -> bool:
    """Returns whether the call may have begun something. One that took a while before the link was lost may have."""
    if call.accepted_count:
        return True
    if call.outcome in ("LINK_LOST", "UNAVAILABLE"):
        return call.ended_s - call.began_s > 0.05
    if call.outcome == "DAEMON_UNREACHABLE" and "no UAL daemon" in call.text:
        return False  # no daemon listened yet
    if call.outcome == "GEOFENCE" and "this has changed in flight" in call.text:
        return True  # it was accepted before the fence came
    return call.outcome not in REFUSED


def until_s(call: Called) -> float:
    """Until when what a call has begun may last."""
    return math.inf if call.outcome in _GOING_ON and call.name in TASKS else call.ended_s


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
    for call in record.called:
        if call.began_s <= time_s <= call.ended_s + 1.0 and call.name == "take_off":
            found |= modes.takes_off | {modes.hold}
        if call.began_s <= time_s <= until_s(call) + 1.0 and call.name == "mission":
            found |= {modes.mission, modes.hold}
    return found


def _take_overs(record: Record, changes: Sequence[Known], modes: Modes) -> list[float]:
    """Returns the times at which the daemon was told that something else has taken the armed vehicle out of a mode of
    ours.

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


def allowed_from_s(case: Case, sent: Sent) -> float:
    """The last time at which whatever allowed the daemon to fly ended: its start, a take-over, the disarming."""
    record = case.record
    ends = [life.time_s for life in record.lives if life.what == DAEMON_STARTED]
    noticed_s, shown_s = known_since_s(record, sent.time_s, NOTICED_S), known_since_s(record, sent.time_s, STATE_S)
    ends += [time_s for time_s in case.taken_s if time_s < noticed_s]
    ends += [time_s for time_s in case.disarmed_s if time_s < shown_s]
    return max((time_s for time_s in ends if time_s <= sent.time_s), default=-math.inf)


# --- How it was flown, and how wrong the estimate was ---


def executed(case: Case) -> Iterator[tuple[Located, float]]:
    """Yields the positions of the vehicle while the daemon's setpoints flew it; and since when they had, without a
    pause.

    Where its daemon is gone an autopilot flies on by itself: ArduCopter follows the last velocity for 3 s.
    """
    times, since_s = case.setpoints_s, math.inf
    killed_s = [life.time_s for life in case.record.lives if life.what == DAEMON_KILLED]
    for each in case.record.truth:
        index = bisect.bisect_right(times, each.time_s)
        is_flown = index > 0 and each.time_s - times[index - 1] <= FLOWN_S
        is_flown = is_flown and not any(times[index - 1] <= time_s <= each.time_s for time_s in killed_s)
        since_s = min(since_s, each.time_s) if is_flown else math.inf
        if is_flown:
            yield each, since_s


def is_befallen(record: Record, kinds: Collection[str], since_s: float, until_s: float) -> bool:
    """Returns whether one of these faults was under way at some time in between."""
    return any(each.kind in kinds and each.began_s <= until_s and each.ended_s >= since_s for each in record.troubles)


def estimate_error_m(record: Record, time_s: float) -> float:
    """Returns the error of the autopilot's own estimate: UAL can be no better."""
    estimate, truth = nearest(record.estimate, time_s), nearest(record.truth, time_s)
    return UNKNOWN_M if estimate is None or truth is None else distance_m(estimate, truth)


def nearest(found: Sequence[Located], time_s: float) -> Place | None:
    index = bisect.bisect_left(found, time_s, key=lambda each: each.time_s)
    near = [each for each in found[max(0, index - 1) : index + 1] if abs(each.time_s - time_s) < 0.5]
    return min(near, key=lambda each: abs(each.time_s - time_s)).place if near else None


def position_text(place: Place | None) -> str:
    return "nowhere" if place is None else "(" + ", ".join(f"{value:.1f}" for value in place) + ")"
