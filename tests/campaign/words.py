"""The judge's rule for what UAL says: it names only what is true, and always by the same name."""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterator

from tests.campaign.evidence import FLIES, SERVICES, Breach, Case, Known, begins, is_befallen
from tests.campaign.record import DAEMON_STARTED, Record

_NOT_COMMANDED = "not been commanded in this flight"
_CAUSES = {
    "battery failsafe": ("battery",),
    "rc failsafe": ("rc_loss", "busy"),  # the transmitter's thread is starved, too
    "fence": ("fence", "wide_fence"),
    "setpoint failsafe": ("freeze", "kill_daemon", "silence", "cut", "loss", "delay", "corruption", "busy"),
}
"""The names of causes, and the faults of which one must have begun before."""
_UNKNOWN = "others took it"
_STATION = ("station", "station_upload", "station_clear", "station_jump", "upload", "clear", "second_sender", "home")
_OTHERS = {
    "safety pilot": ("pilot", "stop"),  # PX4 takes the gesture that stops the motors for a take-over, too
    "ground station": _STATION,
    _UNKNOWN: ("pilot", "stop", *_STATION),
}
"""Other holders that are named, and the faults and orders in which they act. A flight that is not UAL's is theirs."""
_NAMES = (*_CAUSES, "safety pilot", "ground station", "position failsafe", "failsafe")
_FAILSAFES = ("battery", "rc_loss", "fence", "wide_fence", "ekf")
_HIDING = ("loss", "delay", "corruption", "silence", "cut", "busy", "kill_daemon", "reboot")
_SHOWN_S = 1.0
_AFTER_S = 6.0
_BEGUN_S = 0.5


def words_are_true(case: Case) -> Iterator[Breach]:
    """Yields untrue reports about the flight and its takers; one stay in a mode of others has one cause."""
    yield from _commanded(case)
    yield from _possible(case)
    yield from _one_name(case)


def _commanded(case: Case) -> Iterator[Breach]:
    """A flight that was commanded is never said not to have been."""
    record = case.record
    flights = [life.time_s for life in record.lives if life.what == DAEMON_STARTED] + case.disarmed_s
    calls = [call for call in record.called if call.name in FLIES - SERVICES - {"arm", "disarm"} and begins(call)]
    for said in record.said:
        if _NOT_COMMANDED not in said.reason:
            continue
        since_s = max((time_s for time_s in flights if time_s <= said.time_s), default=-math.inf)
        begun = [call.name for call in calls if since_s < call.began_s < said.time_s - _BEGUN_S]
        if begun:
            yield Breach("words", said.time_s, f"{said.reason!r} is told after {begun[-1]}")


def _possible(case: Case) -> Iterator[Breach]:
    """A cause is named only where it can have been; never a failsafe where a ground station has it land."""
    record = case.record
    named = [(said.time_s, cause_in(said.reason), said.reason) for said in record.said]
    named += [(call.ended_s, call.by, f"{call.name} ended: {call.text}") for call in record.called]
    for time_s, cause, text in named:
        kinds = _CAUSES.get(cause)
        if kinds is not None and not is_befallen(record, kinds, -math.inf, time_s):
            yield Breach("words", time_s, f"{text!r} names {cause!r}, and nothing caused it")
        elif kinds is not None and _is_a_stations(record, case, time_s):
            yield Breach("words", time_s, f"{text!r} names {cause!r}, and a ground station had it land")
    if not any(order.what == "fly" for order in record.orders):
        yield from _others(record)
    for call in record.called:
        if call.outcome == "INTERNAL":
            yield Breach("words", call.ended_s, f"{call.name} met a defect of the daemon: {call.text!r}")
        if call.outcome == "TASK_ABORTED" and not call.by:
            yield Breach("words", call.ended_s, f"{call.name} was ended by nothing: {call.text!r}")


def _others(record: Record) -> Iterator[Breach]:
    """Nobody else is named where only UAL has commanded."""
    for who, kinds in _OTHERS.items():
        named = [
            (said.time_s, said.reason)
            for said in record.said
            if cause_in(said.reason) == who
            or f"{who} took it" in said.reason
            or (who == _UNKNOWN and who in said.reason)
        ]
        named += [(call.ended_s, f"{call.name} ended: {call.text}") for call in record.called if call.by == who]
        for time_s, text in named:
            if who != _UNKNOWN and is_befallen(record, _HIDING, time_s - _AFTER_S, time_s):
                continue  # what tells them apart may be lost
            acts = [order for order in record.orders if order.what in kinds and order.time_s <= time_s]
            if not acts and not is_befallen(record, kinds, -math.inf, time_s):
                yield Breach("words", time_s, f"{text!r} names {who!r}, and nobody else did anything")


def _is_a_stations(record: Record, case: Case, time_s: float) -> bool:
    """Returns whether a ground station's order changed the mode last, and no failsafe can have."""
    orders = [each.began_s for each in record.troubles if each.kind == "station" and each.began_s < time_s]
    changes = [each.time_s for each in _modes(case) if each.time_s <= time_s]
    if not orders or not changes or not 0.0 <= changes[-1] - orders[-1] < _SHOWN_S:
        return False
    return not is_befallen(record, _FAILSAFES, orders[-1] - _AFTER_S, time_s)


def _one_name(case: Case) -> Iterator[Breach]:
    """While the vehicle stays in the mode that took it, its cause keeps its name, which the ended task gave, too."""
    record = case.record
    changes_s = [each.time_s for each in _modes(case)]
    for taken_s in case.taken_s:
        index = bisect.bisect_right(changes_s, taken_s)
        until_s = changes_s[index] if index < len(changes_s) else math.inf
        begun_s = (call.began_s for call in record.called if call.name in FLIES - SERVICES and begins(call))
        until_s = min((until_s, *(time_s for time_s in begun_s if time_s > taken_s)))  # UAL's own is told at once
        if is_befallen(record, _HIDING, taken_s - _AFTER_S, taken_s + _SHOWN_S):
            continue
        frozen_s = [each.ended_s for each in record.troubles if each.kind == "freeze" and each.began_s < taken_s]
        shown_s = max((taken_s, *frozen_s)) + _SHOWN_S
        told = [said for said in record.said if said.reason and shown_s < said.time_s < until_s]
        names = {cause_in(said.reason) for said in told if said.state in ("FLYING_MANUAL", "LANDING")}
        names |= {call.by for call in record.called if call.by in _NAMES and 0.0 <= call.ended_s - taken_s < _SHOWN_S}
        if len(names) > 1:
            yield Breach("words", taken_s, f"one cause has {len(names)} names: {sorted(names)}")


def _modes(case: Case) -> Iterator[Known]:
    """Yields the knowledge at each change of the mode."""
    before = None
    for each in case.changes:
        if each.mode != before:
            yield each
        before = each.mode


def cause_in(reason: str) -> str:
    """Returns the cause that a reason of a state names last; empty where it names none."""
    cause = reason.rpartition(": ")[2].partition(";")[0]  # behind it may stand that the motors are stopped
    cause = cause.rstrip(")")  # of a vehicle that does not follow it comes in brackets
    return cause if cause in _NAMES else ""
