"""What the autopilot's mode tells a flight."""

from __future__ import annotations

from ual_daemon.backends.values import Control, Snapshot


def mode_name(snapshot: Snapshot) -> str:
    """Returns the name of the mode; empty if it is not known."""
    return "" if snapshot.control.mode is None else snapshot.control.mode.value.name


def is_control_given_up(snapshot: Snapshot) -> bool:
    """Whether the autopilot is in a mode in which it does not obey UAL."""
    return snapshot.control.mode is not None and snapshot.control.mode.value.control not in (
        Control.REFERENCES,
        Control.TAKE_OFF,
    )
