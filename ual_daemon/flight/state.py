"""The state of the UAV, as a pure function of one snapshot: estimated at each update, never remembered."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

from ual.shared.immutable import immutable
from ual.types import State
from ual_daemon.backends.values import NEVER_S, Cause, Control, Freshness, LandedState, Sample, Snapshot

_SCHEDULING_GAP_S = 0.5
"""A backend publishes every 0.1 s at least; one that has not for this long is starved."""
_STILL_M_S, _AT_HOME_M = 0.4, 0.8
"""Speed below which a UAV stands still, and the height over its home below which it may then lie on the ground."""
_LARGEST_TILT_COSINE = math.cos(math.radians(70.0))
"""Cosine of a tilt in which nothing stands still in the air."""
_FLYING_AUTO, _TAKING_OFF, _LANDING = State.FLYING_AUTO, State.TAKING_OFF, State.LANDING
_IN_AIR, _ON_GROUND = LandedState.IN_AIR, LandedState.ON_GROUND
_TAKES_OFF, _LANDS = LandedState.TAKING_OFF, LandedState.LANDING
_REFERENCES, _TAKE_OFF, _LAND = Control.REFERENCES, Control.TAKE_OFF, Control.LAND
"""As names of the module: Python looks up a member of an enumeration by a call, and each update would pay."""


@immutable
class Estimate:
    """The state, why it is that state (human-readable), and whether anything is heard from the autopilot."""

    state: State
    why: str
    is_link_up: bool = True


def estimate(
    snapshot: Snapshot, freshness: Freshness, manoeuvre: State | None = None, note: str = "", mission: str = ""
) -> Estimate:
    """Estimates the state from the data, in the order of `ual.v1.State`.

    `manoeuvre` is TAKING_OFF or LANDING while a take-off or landing of UAL is in progress; None otherwise. `note` is
    added to the reason of FLYING_AUTO. `mission` says what the autopilot does in a mission that is a task of UAL; empty
    where it flies none.
    """
    if not _is_all_fresh(snapshot, freshness):
        missing = _why_uninitialized(snapshot, freshness)
        if missing is not None:
            return _not_blaming(_with_doing(missing, snapshot, freshness), snapshot)
    # Both functions have checked these.
    known = snapshot.control
    assert known.armed is not None
    assert known.mode is not None
    landed = LandedState.UNKNOWN if known.landed is None else known.landed.value
    control = known.mode.value.control
    mode = known.mode.value.own_text or known.mode.value.name
    if not known.armed.value:
        starts = known.mode.value.arming_starts
        return Estimate(State.LANDED_DISARMED, f"not armed; {starts}" if starts else "not armed")
    if landed is _ON_GROUND:
        return Estimate(State.LANDED_ARMED, "armed, on the ground")
    if manoeuvre is _TAKING_OFF:
        return Estimate(_TAKING_OFF, "our take-off is under way")
    if landed is _TAKES_OFF or control is _TAKE_OFF:
        return Estimate(_TAKING_OFF, f"the autopilot takes off (mode {mode})")
    if manoeuvre is _LANDING:
        return Estimate(_LANDING, "our landing is under way")
    if landed is _LANDS or control is _LAND:
        return Estimate(_LANDING, _how_it_lands(snapshot, mission))
    if mission:
        return Estimate(_FLYING_AUTO, f"in the air, {mission} (mode {mode})")
    if control is _REFERENCES:
        return _in_auto(mode, note)
    return _in_manual(mode, known.held_by, snapshot)


def why_it_may_lie(snapshot: Snapshot) -> str:
    """Returns that a UAV which its autopilot takes to be in the air may lie on the ground; empty where it flies.

    PX4 takes one that has fallen to be in the air for long: until its motors run, or until nothing of it turns.
    """
    stopped = "; the autopilot has stopped its motors" if snapshot.control.failsafe is Cause.TERMINATION else ""
    stands = why_it_stands(snapshot)
    return f"{stopped}; {stands}" if stands else stopped


def why_it_stands(snapshot: Snapshot, *, is_ground_known: bool = False) -> str:
    """Returns how it stands as on the ground; empty where it does not.

    `is_ground_known`: it has been seen to leave the ground, so that it may hover at the height of its home.
    """
    if not is_still(snapshot):
        return ""
    assert snapshot.motion.pose is not None
    x, y, *_ = snapshot.motion.pose.value.orientation
    if 1.0 - 2.0 * (x * x + y * y) < _LARGEST_TILT_COSINE:
        return "it stands still, tilted as nothing flies, and lies on the ground"
    if is_ground_known or not is_at_ground_height(snapshot, None):
        return ""
    return "it stands still at the height of its home, and may lie there"


def is_still(snapshot: Snapshot) -> bool:
    """Returns whether it stands still, by data that are there."""
    velocity, pose = snapshot.motion.velocity, snapshot.motion.pose
    return velocity is not None and pose is not None and velocity.value.linear.norm() <= _STILL_M_S


def is_at_ground_height(snapshot: Snapshot, ground_z_m: float | None) -> bool:
    """Returns whether it is as high as the ground, or as its home where that is None: it may be on it."""
    pose, projection, home_m = snapshot.motion.pose, snapshot.earth.projection, snapshot.earth.home_altitude_amsl_m
    if ground_z_m is None and projection is not None and home_m is not None:
        ground_z_m = home_m - projection.altitude_amsl_m
    return pose is not None and ground_z_m is not None and abs(pose.value.position.z - ground_z_m) < _AT_HOME_M


def noted(found: Estimate, note: str) -> Estimate:
    """Returns an estimate, with the note of one of FLYING_AUTO: what `estimate` finds where nothing is declared."""
    return Estimate(found.state, found.why + note) if note and found.state is _FLYING_AUTO else found


def is_surely_auto(snapshot: Snapshot, now_s: float, freshness: Freshness) -> bool:
    """Returns whether `estimate` says FLYING_AUTO now while nothing is declared: the usual case of a stream, in few
    steps.
    """
    known = snapshot.control
    armed, mode, landed = known.armed, known.mode, known.landed
    if armed is None or not armed.value or mode is None or mode.value.control is not _REFERENCES:
        return False
    motion, heard_s = snapshot.motion, snapshot.heard_s
    estimator, pose = motion.estimator, motion.pose
    return (  # as `_is_all_fresh`, which would be a call
        landed is not None
        and landed.value is _IN_AIR
        and heard_s is not None
        and now_s - heard_s <= freshness.link_s
        and now_s - armed.time_s <= freshness.mode_s
        and now_s - mode.time_s <= freshness.mode_s
        and now_s - landed.time_s <= freshness.landed_s
        and estimator is not None
        and now_s - estimator.time_s <= freshness.estimator_s
        and estimator.value.is_good
        and pose is not None
        and now_s - pose.time_s <= freshness.pose_s
        and not snapshot.link.conflict
    )


def _with_doing(missing: Estimate, snapshot: Snapshot, freshness: Freshness) -> Estimate:
    """Returns the same with what the autopilot does meanwhile, where it is armed and in the air, and says its mode."""
    control, now_s = snapshot.control, snapshot.time_s
    armed, mode = control.armed, control.mode
    if armed is None or mode is None or not armed.value or control.is_on_ground or not missing.is_link_up:
        return missing
    landed = control.landed or Sample(LandedState.UNKNOWN, now_s)
    is_old = now_s - min(armed.time_s, mode.time_s) > freshness.mode_s or now_s - landed.time_s > freshness.landed_s
    if is_old or snapshot.link.conflict:
        return missing
    if landed.value is LandedState.LANDING or mode.value.control is _LAND:
        does = f"the autopilot lands{_in_mode(snapshot)}"
    else:
        does = f"it is in the air, in mode {mode.value.text}{_because(control.held_by)}"
    return replace(missing, why=f"{missing.why}; {does}")


def _not_blaming(missing: Estimate, snapshot: Snapshot) -> Estimate:
    """Returns the same with its real cause, where UAL itself had no time to look for data."""
    pause_s = snapshot.time_s - snapshot.updated_s
    own = (
        f"this computer has not run UAL for {pause_s:.1f} s" if pause_s > _SCHEDULING_GAP_S else snapshot.scheduling_gap
    )
    return replace(missing, why=f"{own}: {missing.why}") if own and not snapshot.link.conflict else missing


@lru_cache(maxsize=64)  # every setpoint calls it
def _in_auto(mode: str, note: str) -> Estimate:
    return Estimate(_FLYING_AUTO, f"in the air, the autopilot takes our references (mode {mode}){note}")


def _in_manual(mode: str, held_by: Cause | None, snapshot: Snapshot) -> Estimate:
    why = f"in the air, mode {mode} does not take our references{_because(held_by)}"
    return Estimate(State.FLYING_MANUAL, f"{why}{why_it_may_lie(snapshot)}")


def _how_it_lands(snapshot: Snapshot, mission: str) -> str:
    """The return of a mission may be in a mode of its own, which else would be taken for a ground station's."""
    if mission and snapshot.control.held_by in (None, Cause.GROUND_STATION, Cause.AUTOPILOT):
        assert snapshot.control.mode is not None
        return f"{mission}, and lands (mode {snapshot.control.mode.value.text})"
    stopped = why_it_may_lie(snapshot) if snapshot.control.failsafe is Cause.TERMINATION else ""
    return f"the autopilot lands{_in_mode(snapshot)}{stopped}"


def _in_mode(snapshot: Snapshot) -> str:
    """Returns in which mode it lands, and why. The landed state may come ahead of its mode: that is then an old one."""
    assert snapshot.control.mode is not None
    mode = snapshot.control.mode.value
    if mode.control is not _LAND and not mode.is_autonomous:
        return f"; its mode was still {mode.text} when it was told last"
    return f" (mode {mode.text}){_because(snapshot.control.held_by)}"


def _because(held_by: Cause | None) -> str:
    return f": {held_by.value}" if held_by is not None and held_by.value else ""


def _unsaid(why: str, snapshot: Snapshot) -> Estimate:
    refused = f"; it refused to send {snapshot.link.refused}" if snapshot.link.refused else ""
    return Estimate(State.UNINITIALIZED, f"{why}{refused}")


def _silent(why: str, snapshot: Snapshot) -> Estimate:
    trouble = f"; {snapshot.link.trouble}" if snapshot.link.trouble else ""
    return Estimate(State.UNINITIALIZED, f"{why}{trouble}", is_link_up=False)


def _why_uninitialized(snapshot: Snapshot, freshness: Freshness) -> Estimate | None:
    if snapshot.heard_s is None:
        return _silent("nothing heard from the autopilot yet", snapshot)
    if snapshot.link.conflict:
        return Estimate(State.UNINITIALIZED, snapshot.link.conflict)
    silence_s = snapshot.time_s - snapshot.heard_s
    if silence_s > freshness.link_s:
        return _silent(f"nothing heard from the autopilot for {silence_s:.1f} s", snapshot)
    control, motion = snapshot.control, snapshot.motion
    required: tuple[tuple[str, Sample[object] | None, float], ...] = (
        ("whether it is armed", control.armed, freshness.mode_s),
        ("its mode", control.mode, freshness.mode_s),
        ("whether its position is good", motion.estimator, freshness.estimator_s),
    )
    for what, sample, limit_s in required:
        why = _why_stale(what, sample, limit_s, snapshot.time_s)
        if why is not None:
            return _unsaid(why, snapshot)
    assert motion.estimator is not None
    if not motion.estimator.value.is_good:
        return Estimate(State.UNINITIALIZED, f"the autopilot has no good position: {motion.estimator.value.why}")
    why = _why_stale("its pose", motion.pose, freshness.pose_s, snapshot.time_s)
    if why is None and control.landed is not None:  # an autopilot may have no landed state at all
        why = _why_stale("whether it is landed", control.landed, freshness.landed_s, snapshot.time_s)
    return None if why is None else _unsaid(why, snapshot)


def _is_all_fresh(snapshot: Snapshot, freshness: Freshness) -> bool:
    """Returns whether nothing is missing or stale. Fast, because every setpoint and update calls it."""
    now_s, heard_s, control, motion = snapshot.time_s, snapshot.heard_s, snapshot.control, snapshot.motion
    armed, mode, landed = control.armed, control.mode, control.landed
    estimator, pose = motion.estimator, motion.pose
    if heard_s is None or snapshot.link.conflict or armed is None or mode is None or estimator is None or pose is None:
        return False
    return (
        now_s - heard_s <= freshness.link_s
        and now_s - armed.time_s <= freshness.mode_s
        and now_s - mode.time_s <= freshness.mode_s
        and now_s - estimator.time_s <= freshness.estimator_s
        and estimator.value.is_good
        and now_s - pose.time_s <= freshness.pose_s
        and (landed is None or now_s - landed.time_s <= freshness.landed_s)
    )


def _why_stale(what: str, sample: Sample[object] | None, limit_s: float, now_s: float) -> str | None:
    if sample is None or sample.time_s == NEVER_S:
        return f"the autopilot has not said {what}"
    age_s = now_s - sample.time_s
    return f"the autopilot has not said {what} for {age_s:.1f} s" if age_s > limit_s else None
