"""The judge's rules for missions, for the autopilot's own warnings, and for what counts as done."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from tests.campaign.bounds import newest
from tests.campaign.evidence import Breach, Case, estimate_error_m, is_befallen, known_since_s, position_text
from tests.campaign.follows import FALL_M_S, TOLD_S
from tests.campaign.positions import distance_m
from tests.campaign.record import Called, Record

CHANGES = ("upload", "clear")
"""Acts of another station on the mission."""
PASSED_M = 3.0
"""Distance in metres at which a waypoint counts as passed: both autopilots' radius of 2 m, and the overshoot of UAL."""
_CLIMBED_M = 1.0
_LANDED_S = 2.0
_STARVED_S = 0.5
_NAMES = ("station", "mission")
_BROUGHT = "has brought another mission"
_HIDING = ("loss", "delay", "corruption", "silence", "cut", "freeze", "kill_daemon", "reboot")
_PREFIXES = ("PreArm: ", "Arm: ")
_FIGURE = re.compile(r"\d+")
_OVER = {
    "Glitch cleared": "GPS Glitch",
    "EKF Failsafe Cleared": "EKF Failsafe",
    "Dead Reckoning stopped": "Dead Reckoning",
    "Vibration compensation OFF": "Vibration compensation ON",
}
"""Texts that are as severe as those that said that it began, and only say that it is over; and how those begin."""


def a_mission_has_its_owner(case: Case) -> Iterator[Breach]:
    """Yields tasks that do not end within a second, or without the reason, where another station replaces or clears the
    flying mission.

    The second begins when the autopilot has told it.
    """
    record = case.record
    for order in record.orders:
        if order.what not in CHANGES or is_befallen(record, _HIDING, order.time_s - TOLD_S, order.time_s + TOLD_S):
            continue
        heard_s = [each.time_s for each in record.missions if each.time_s > order.time_s - TOLD_S]
        due_s = max(order.time_s, min(heard_s, default=-math.inf)) + TOLD_S
        due_s += due_s - known_since_s(record, due_s, 0.0)
        due_s += _STARVED_S * is_befallen(record, ("busy",), order.time_s, due_s)  # its client is, too
        for call in record.called:
            if call.name != "mission" or not call.began_s + TOLD_S < order.time_s < call.ended_s:
                continue
            if min(call.ended_s, _reported_s(record, order.time_s)) > due_s:
                text = f"the mission went on for {call.ended_s - order.time_s:.2f} s after another's {order.what}"
                yield Breach("mission's owner", order.time_s, text)
            if not call.outcome and call.ended_s > order.time_s + TOLD_S:  # before, it may have been complete
                yield Breach("mission's owner", call.ended_s, f"it counts as done after another station's {order.what}")
            elif call.outcome == "TASK_ABORTED" and not any(name in call.text + call.by for name in _NAMES):
                yield Breach("mission's owner", call.ended_s, f"{call.text!r} does not name the other station")


def _reported_s(record: Record, since_s: float) -> float:
    """Returns the time at which a state said that another station has brought its mission: a client may sleep in a
    pause meanwhile.
    """
    return min(
        (said.time_s for said in record.said if said.time_s > since_s and _BROUGHT in said.reason), default=math.inf
    )


def no_part_of_a_mission_flies(case: Case) -> Iterator[Breach]:
    """A mission that was cut off amid its upload is not started before an upload has ended well.

    So it has where the autopilot has told it: its client may be gone before it ends.
    """
    record = case.record
    items_s = [sent.time_s for sent in record.sent if sent.what.startswith("mission_item")]
    uploads = [call for call in record.called if call.name == "upload"]
    for number, call in enumerate(uploads):
        if not call.outcome or not any(call.began_s <= time_s <= call.ended_s for time_s in items_s):
            continue
        mended = [each.ended_s for each in uploads[number + 1 :] if not each.outcome]
        mended += [each.time_s for each in record.uploaded if each.time_s > call.began_s]
        mended_s = min(mended, default=math.inf)
        for sent in record.sent:
            if sent.mode == case.modes.mission and call.ended_s < sent.time_s < mended_s:
                text = f"a mission is started whose upload was cut off at {call.ended_s:.2f} ({call.outcome})"
                yield Breach("no part", sent.time_s, text)


def what_is_severe_is_reported(case: Case) -> Iterator[Breach]:
    """A text of the autopilot of severity 0 to 2 is in the health, or in the reason of the state, within a second.

    One that says that something is over takes that out of the health within a second.
    """
    record = case.record
    for text in record.texts:
        due_s = text.time_s + TOLD_S
        since_s = known_since_s(record, due_s, TOLD_S)
        if since_s < text.time_s or _is_unheard(record, due_s):
            continue
        if text.text in _OVER:
            last = newest(record.healths, due_s, due_s)
            if last and _OVER[text.text] in last[-1].text and not _comes_again(record, _OVER[text.text], text.time_s):
                yield Breach("texts", due_s, f"{text.text!r} has come, and {_OVER[text.text]!r} is still told")
            continue
        words = _check(text.text)
        told = [each.text for each in newest(record.healths, text.time_s, due_s)]
        told += [said.reason for said in record.said if text.time_s <= said.time_s <= due_s]
        if not any(words in (each if words == text.text else _without_figures(each)) for each in told):
            yield Breach("texts", due_s, f"{text.text!r} is not told")


def _check(text: str) -> str:
    """Returns what is to be told of a text: of a check before the arming, that it fails, whatever its figure is now."""
    for prefix in _PREFIXES:
        if text.startswith(prefix):
            return _without_figures(text.removeprefix(prefix))
    return text


def _without_figures(text: str) -> str:
    return _FIGURE.sub("", text)


def _comes_again(record: Record, words: str, since_s: float) -> bool:
    return any(each.time_s > since_s and each.text.startswith(words) for each in record.texts)


def _is_unheard(record: Record, time_s: float) -> bool:
    """Returns whether the daemon, or the subscriber, did not run then."""
    return is_befallen(record, ("kill_daemon", "reboot"), time_s - _LANDED_S, time_s) or not any(
        time_s - TOLD_S <= said.time_s for said in record.said
    )


def what_is_done_was_reached(case: Case) -> Iterator[Breach]:
    """A take-off was that high, a landing was no fall, and a mission passed each of its places, by the truth."""
    for call in case.record.called:
        if call.outcome:
            continue
        if call.height_m is not None:
            yield from _climbed(case.record, call, call.height_m)
        if call.name in ("land", "rtl"):
            yield from _fell(case.record, call)
        if call.goals:
            yield from _passed(case.record, call)


def _climbed(record: Record, call: Called, height_m: float) -> Iterator[Breach]:
    heights = [each.place[2] for each in record.truth if call.began_s <= each.time_s <= call.ended_s]
    if not heights:
        return
    missed_m = heights[0] + height_m - max(heights)
    allowed_m = _CLIMBED_M + estimate_error_m(record, call.ended_s)
    if missed_m > allowed_m:
        text = f"take_off to {height_m:.1f} m was reported as done {missed_m:.2f} m below (allowed {allowed_m:.2f})"
        yield Breach("goal", call.ended_s, text)


def _fell(record: Record, call: Called) -> Iterator[Breach]:
    near = [each for each in record.truth if -_LANDED_S <= each.time_s - call.ended_s <= TOLD_S and each.velocity]
    down_m_s = max((-each.velocity[2] for each in near if each.velocity), default=0.0)
    if down_m_s > FALL_M_S:
        yield Breach("goal", call.ended_s, f"{call.name} was reported as done, and was a fall at {down_m_s:.1f} m/s")


def _passed(record: Record, call: Called) -> Iterator[Breach]:
    way = [each for each in record.truth if call.began_s <= each.time_s <= call.ended_s + TOLD_S]
    heights_m = [each.place[2] for each in newest(record.homes, call.began_s, call.ended_s)] or [0.0]
    begin, moved_m = 0, max(heights_m) - min(heights_m)  # its heights go after home
    errors_m = [estimate_error_m(record, each.time_s) for each in way]  # a barometer's may end before the mission
    for number, goal in enumerate(call.goals):
        beside_m = [distance_m(each.place, goal) - error_m for each, error_m in zip(way, errors_m, strict=True)]
        passed = [index for index in range(begin, len(way)) if beside_m[index] <= PASSED_M + moved_m]
        if not passed:
            nearest_m = min(beside_m[begin:], default=math.inf)
            text = f"the mission counts as done, and passed its place {number + 1} {position_text(goal)}"
            allowed = f"allowed {PASSED_M + moved_m:.2f} beside the error of the estimate"
            yield Breach("goal", call.ended_s, f"{text} at {nearest_m:.2f} m ({allowed})")
            return
        begin = passed[0]
