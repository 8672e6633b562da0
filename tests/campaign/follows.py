"""The judge's rules for a vehicle that fails: it is told whether it follows, and nothing moves unasked."""

from __future__ import annotations

import bisect
import math
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from tests.campaign.evidence import (
    DISTURBING,
    ENTERS,
    FLIES,
    WAKE_S,
    Breach,
    Case,
    begins,
    between,
    is_befallen,
    known_since_s,
    nearest,
    until_s,
)
from tests.campaign.record import DAEMON_KILLED, DAEMON_STARTED, Located, Record, Sent

TOLD_S = 1.0
"""By then it is told."""
BESIDE_M, BESIDE_S = 3.0, 3.0
"""A vehicle that is so far beside what was asked, and goes farther, or comes no nearer for so long, does not follow."""
FALL_M_S = 4.5
"""Faster than any descent of a campaign: both autopilots descend with 2 m/s at most unless they are asked."""
_FALLS_S, _FARTHER_S, _FARTHER_M = 0.1, 0.5, 0.15
_LEADING_S = 0.5
"""A fast reference may be so much farther ahead."""
_NEARER_M = 0.5
_OFF_M_S, _OFF_SHARE = 2.0, 0.3
_PAUSE_S = 0.3
"""The longest interruption of a trouble that lasts."""
LOW_M, _HIGH_M = 0.3, 1.0
"""A vehicle that is lower lies, one that is higher has lifted off."""
_LIES_S, _STILL_M_S = 1.0, 0.3
_ARMED_S = 8.0
"""The longest time from an order to its arming."""
_HEARS_S = 2.5
"""Seconds that a daemon that was started needs until it has heard everything once."""
_BROKEN_OFF = ("DAEMON_UNREACHABLE", "LINK_LOST")
_OWN_CLIMB_S = 8.0
"""ArduCopter's own take-off goes on where its daemon is gone; so long after the call it has lifted off."""
_BLINDING = ("ekf", "gps_jam", "gps_jump", "compass", "barometer", "accelerometer", "origin")
"""Faults that make the autopilot's own estimate wrong: where it takes itself to be then says nothing."""
_MOVING = frozenset({"take_off", "rtl", "go_to", "go_to_geo", "go_above_home", "path", "velocity", "pose", "mission"})
_LIFTING = (_MOVING | ENTERS) - {"land", "arm"}
_STRANGERS = ("pilot", "station", "second_sender", "rc_loss", "battery")
"""Faults in which somebody or something else flies it."""
_BEFALLING = (*_BLINDING, "stop", "motor_off", "motor_weak", "disarmed", "held", "wind", "second_sender")
"""Faults by which it may not follow, or may not know that it does."""
_BEFALLEN_S = 10.0
_NOW = "the UAV does not follow"
_SAYS_SO = ("not follow", "in the air, and the")
"""The words of UAL: "the UAV does not follow: ...", "the motors were disarmed in the air, and the UAV falls ..."."""


@dataclass(frozen=True)
class Stray:
    """A time in which the vehicle does not follow what was asked."""

    began_s: float
    ended_s: float
    what: str


def follows(case: Case) -> Iterator[Breach]:
    """A vehicle that does not follow is told as that within a second, and no new motion is accepted."""
    record = case.record
    released_s = -math.inf
    for stray in strays(case):
        if stray.began_s < released_s or _has_no_witness(record, stray):
            continue  # the same fall, or one that no daemon can have seen
        told_s = stray.began_s + TOLD_S
        due_s = told_s + (told_s - known_since_s(record, told_s, 0.0))
        is_over = not record.said or record.said[-1].time_s < due_s
        if not is_over and not _is_reported(record, stray.began_s, due_s):
            yield Breach("follows", due_s, f"{stray.what} since {stray.began_s:.2f}, which is not told")
        released_s = _released_s(case, stray)
        for call in record.called:
            if call.name in _MOVING | {"arm"} and due_s < call.began_s < released_s and begins(call):
                text = f"{call.name} was accepted although it did not follow: {stray.what} since {stray.began_s:.2f}"
                yield Breach("follows", call.began_s, text)


def nothing_is_cried_wolf(case: Case) -> Iterator[Breach]:
    """Yields reports that it does not follow without cause: nothing has befallen the vehicle, and it follows by the
    truth.
    """
    record, was_told = case.record, True  # what is told at the begin is of the flight before
    found = strays(case)
    for said in record.said:
        is_told = _NOW in said.reason
        if is_told and not was_told and not _is_so(record, found, said.time_s):
            yield Breach("follows", said.time_s, f"{said.reason[:100]!r} is told, and nothing befell it")
        was_told = is_told


def _is_so(record: Record, found: Sequence[Stray], time_s: float) -> bool:
    if is_befallen(record, _BEFALLING, time_s - _BEFALLEN_S, time_s):
        return True
    return any(stray.began_s - BESIDE_S <= time_s <= stray.ended_s + _BEFALLEN_S for stray in found)


def _has_no_witness(record: Record, stray: Stray) -> bool:
    """Returns whether it was over before the daemon that runs since had heard everything once."""
    return any(
        stray.began_s - TOLD_S < life.time_s and stray.ended_s <= life.time_s + _HEARS_S
        for life in record.lives
        if life.what == DAEMON_STARTED
    )


def strays(case: Case) -> list[Stray]:
    """Returns when it did not follow, in the order of time."""
    return sorted([*_falls(case), *_besides(case), *_offs(case), *_drops(case)], key=lambda each: each.began_s)


def _is_reported(record: Record, since_s: float, until_s: float) -> bool:
    """Returns whether some state says so, or that nothing is known."""
    return any(
        since_s - _FARTHER_S <= said.time_s <= until_s
        and (said.state == "UNINITIALIZED" or any(words in said.reason for words in _SAYS_SO))
        for said in record.said
    )


def _released_s(case: Case, stray: Stray) -> float:
    """Returns the time from which a new motion may be accepted again: recovered, on request, or it lies disarmed."""
    times = [
        call.ended_s
        for call in case.record.called
        if call.name == "recover" and not call.outcome and call.began_s > stray.began_s
    ]
    times += [each for each in case.disarmed_s if each > stray.began_s and height_m(case, each) < LOW_M]
    times += [lying.time_s for lying in lyings(case) if lying.time_s > stray.began_s and not _is_armed(case, lying)]
    return min(times, default=math.inf)


def _is_armed(case: Case, each: Located) -> bool:
    return any(known.armed for known in between(case.changes, each.time_s, each.time_s))


def _falls(case: Case) -> Iterator[Stray]:
    """It goes down faster than anything that was asked."""
    times = [sent.time_s for sent in case.record.sent if sent.velocity]
    velocities = [sent.velocity[2] for sent in case.record.sent if sent.velocity]
    falling: list[float] = []
    for each in case.record.truth:
        if each.velocity is None:
            continue
        begin, end = (bisect.bisect_left(times, each.time_s - back_s) for back_s in (BESIDE_S, 0.0))
        if each.velocity[2] < min((*velocities[begin:end], 0.0)) - FALL_M_S:
            falling.append(each.time_s)
    yield from _lasting(falling, _FALLS_S, "it falls")


def _drops(case: Case) -> Iterator[Stray]:
    """It is disarmed in the air."""
    for time_s in case.disarmed_s:
        # An autopilot may tell of it a second late: PX4's heartbeat.
        up_m = min(height_m(case, time_s - back_s) for back_s in (0.0, 0.5))
        if up_m > _HIGH_M:
            yield Stray(time_s, time_s + BESIDE_S, f"it was disarmed {up_m:.1f} m up")


def _besides(case: Case) -> Iterator[Stray]:
    """It is beside the place to which the daemon's setpoints lead it, and goes farther, or comes no nearer."""
    farther: list[float] = []
    far: list[float] = []
    before: deque[tuple[float, float]] = deque()
    nearest_m = math.inf
    for sent in case.record.sent:
        if sent.what != "setpoint":
            continue
        if sent.way is None or not _is_assessed(case, sent, _BLINDING) or _is_held(case, sent):
            nearest_m = math.inf
            continue
        off_m = math.hypot(*sent.way)
        if off_m <= BESIDE_M + _LEADING_S * math.hypot(*(sent.velocity or (0.0,))):
            nearest_m = math.inf
            continue
        if off_m < nearest_m - _NEARER_M:
            nearest_m = off_m
            far.append(-math.inf)  # what comes nearer begins anew
        far.append(sent.time_s)
        before.append((sent.time_s, off_m))
        while before[0][0] < sent.time_s - _FARTHER_S:
            before.popleft()
        if off_m > before[0][1] + _FARTHER_M:
            farther.append(sent.time_s)
    yield from _lasting(farther, _FARTHER_S, "it goes away from what was asked")
    yield from _lasting(far, BESIDE_S, f"it is more than {BESIDE_M:.0f} m beside what was asked")


def _is_held(case: Case, sent: Sent) -> bool:
    """Returns whether it is to take off and has not lifted off: the rule `way` says how long its task may take to
    tell.
    """
    is_taking_off = any(
        call.name == "take_off" and call.began_s <= sent.time_s <= until_s(call) for call in case.record.called
    )
    return is_taking_off and height_m(case, sent.time_s) < LOW_M


def _offs(case: Case) -> Iterator[Stray]:
    """Its velocity is not the one that was asked, and comes no nearer to it."""
    off: list[float] = []
    truth, began_m_s = case.record.truth, math.inf
    for sent in case.record.sent:
        if sent.what != "setpoint" or sent.velocity is None or sent.way is not None:
            continue
        index = bisect.bisect_left(truth, sent.time_s, key=lambda each: each.time_s)
        velocity = truth[index - 1].velocity if index else None
        if velocity is None or not _is_assessed(case, sent, ()):
            continue
        off_m_s = math.dist(velocity, sent.velocity)
        if off_m_s <= _OFF_M_S + _OFF_SHARE * math.hypot(*sent.velocity):
            began_m_s = math.inf
            continue
        if off_m_s < began_m_s - _NEARER_M:
            began_m_s = off_m_s
            off.append(-math.inf)
        off.append(sent.time_s)
    yield from _lasting(off, BESIDE_S, "it does not fly the velocity that was asked")


def _is_assessed(case: Case, sent: Sent, kinds: Sequence[str]) -> bool:
    """Returns whether the autopilot followed setpoints then, and nothing but the vehicle was disturbed."""
    if is_befallen(case.record, (*DISTURBING, *kinds), sent.time_s - WAKE_S - TOLD_S, sent.time_s):
        return False
    now = list(between(case.changes, sent.time_s - TOLD_S, sent.time_s))
    return bool(now) and all(each.mode == case.modes.references and each.armed for each in now)


def _lasting(times: Sequence[float], needed_s: float, what: str) -> Iterator[Stray]:
    """Joins times that follow each other; those that last for long enough."""
    began_s = ended_s = -math.inf
    for time_s in (*times, math.inf):
        if not time_s - ended_s <= _PAUSE_S:
            if ended_s - began_s >= needed_s:
                yield Stray(began_s + needed_s, ended_s, what)
            began_s = time_s
        ended_s = time_s


# --- Nobody armed, nothing flies --------------------------------------------------------------------------------------


def nothing_flies_unasked(case: Case) -> Iterator[Breach]:
    """It is armed only where somebody armed it; it lifts off only where somebody asked since it lay, and still does."""
    record = case.record
    began_s = record.truth[0].time_s if record.truth else -math.inf  # what was told before is known, too
    for before, after in zip(case.changes, case.changes[1:], strict=False):
        if after.time_s < began_s:
            continue
        if after.armed and before.armed is False and not _is_armed_by_somebody(record, after.time_s):
            yield Breach("nothing flies", after.time_s, "it is armed, and nobody armed it")
    lay_s = -math.inf
    lying = {each.time_s for each in lyings(case)}
    is_up = True
    for each in record.truth:
        if each.time_s in lying:
            lay_s, is_up = each.time_s, False
        elif not is_up and each.place[2] - _ground_m(record) > _HIGH_M:
            is_up = True
            is_by_itself = _rises_by_itself(case, lay_s, each.time_s)
            if not is_by_itself and not _is_lifted_by_somebody(case, lay_s, each.time_s):
                text = f"it lifts off {each.time_s - lay_s:.1f} s after it lay, and nobody asks for that"
                yield Breach("nothing flies", each.time_s, text)


def lyings(case: Case) -> Iterator[Located]:
    """Yields where it has lain still on the ground for a second."""
    since_s, ground_m = math.inf, _ground_m(case.record)
    for each in case.record.truth:
        is_moving = each.velocity is not None and math.hypot(*each.velocity) > _STILL_M_S
        if is_moving or each.place[2] - ground_m > LOW_M:
            since_s = math.inf
            continue
        since_s = min(since_s, each.time_s)
        if each.time_s - since_s >= _LIES_S:
            yield each


def _is_armed_by_somebody(record: Record, time_s: float) -> bool:
    orders = [order for order in record.orders if order.what in ("arm", "armed")]
    before = [order for order in orders if order.time_s <= time_s]
    if any(order.what == "arm" and time_s - order.time_s < _ARMED_S for order in before):
        return True
    after = orders[len(before) :]
    if before and after and (before[-1].what, after[0].what) == ("arm", "armed"):  # its pilot has tried for so long
        return True
    return any(call.name == "arm" and call.began_s <= time_s <= until_s(call) + _ARMED_S for call in record.called)


def _rises_by_itself(case: Case, lay_s: float, time_s: float) -> bool:
    """Returns whether it rises in its own landing, or in a mode of its pilot, and the daemon sends nothing: its motors
    were weak, and it makes up for that.
    """
    modes = case.modes
    ours = {modes.references, *modes.takes_off, modes.returns, modes.hold, modes.mission}
    is_left = all(each.mode not in ours for each in between(case.changes, lay_s - _LIES_S, time_s))
    return is_left and not any(lay_s - _LIES_S <= sent.time_s <= time_s for sent in case.record.sent)


def _is_lifted_by_somebody(case: Case, lay_s: float, time_s: float) -> bool:
    """Returns whether a command goes on, or was done, since it lay for the last time, or something else flies it."""
    record = case.record
    if is_befallen(record, _STRANGERS, lay_s - TOLD_S, time_s) or any(order.what == "fly" for order in record.orders):
        return True
    if _is_left_to_itself(record, lay_s, time_s) or _is_led_by_its_fence(case, lay_s, time_s):
        return True
    if any(
        call.name == "take_off" and call.outcome in _BROKEN_OFF and 0.0 < time_s - call.began_s < _OWN_CLIMB_S
        for call in record.called
    ):
        return True
    asked = [call for call in record.called if call.name in _LIFTING and begins(call) and call.began_s <= time_s]
    return any(
        until_s(call) + TOLD_S + WAKE_S >= time_s or (not call.outcome and call.ended_s > lay_s) for call in asked
    )


def _is_led_by_its_fence(case: Case, lay_s: float, time_s: float) -> bool:
    """Returns whether its own fence was narrower than where it stood: ArduCopter, armed, lifts off to return, and PX4
    climbs back to its hold when its motors work again.
    """
    is_fenced = is_befallen(case.record, ("fence", "wide_fence"), lay_s - TOLD_S, time_s)
    now = list(between(case.changes, time_s, time_s))
    return is_fenced and bool(now) and now[-1].mode in (case.modes.returns, case.modes.hold)


def _is_left_to_itself(record: Record, lay_s: float, time_s: float) -> bool:
    """Returns whether its daemon was killed before it lay, and none has sent anything since but a landing: its
    autopilot follows what that daemon has asked last.
    """
    killed_s = [life.time_s for life in record.lives if life.what == DAEMON_KILLED and life.time_s <= lay_s]
    landings = [call for call in record.called if call.name == "land"]
    sent_s = [sent.time_s for sent in record.sent if killed_s and killed_s[-1] < sent.time_s <= time_s]
    return bool(killed_s) and all(any(call.began_s <= each <= until_s(call) for call in landings) for each in sent_s)


def _ground_m(record: Record) -> float:
    """The ground of this flight: where it stood at its begin."""
    return record.truth[0].place[2] if record.truth else 0.0


def height_m(case: Case, time_s: float) -> float:
    """Returns how high it was above where it stood at its begin, by the truth."""
    place = nearest(case.record.truth, time_s)
    return 0.0 if place is None else place[2] - _ground_m(case.record)


assert _LIFTING <= FLIES
