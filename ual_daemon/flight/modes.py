"""What the autopilot's mode tells a flight."""

from __future__ import annotations

from ual_daemon.backends.values import Control, LandedState, Snapshot


def mode_name(snapshot: Snapshot) -> str:
    """Returns the name of the mode; empty if it is not known."""
    return "" if snapshot.mode is None else snapshot.mode.value.name


def known_mode(snapshot: Snapshot) -> str:
    """Returns the name of the mode; empty if it may be the one from before the arming, which the arming has changed.

    PX4 tells the arming by an event, and the mode that it was made to enter for it up to a second later.
    """
    mode, armed, landed = snapshot.mode, snapshot.armed, snapshot.landed
    is_on_ground = landed is None or landed.value is LandedState.ON_GROUND
    if mode is not None and armed is not None and is_on_ground and mode.time_s < armed.time_s:
        return ""
    return mode_name(snapshot)


def is_control_given_up(snapshot: Snapshot) -> bool:
    """Whether the autopilot is in a mode in which it does not obey UAL."""
    return snapshot.mode is not None and snapshot.mode.value.control not in (Control.REFERENCES, Control.TAKE_OFF)
