"""The limits of the pilot's rules, one for each rule and the same for all backends.

What depends on a link or an autopilot (how often it is sent again, how late its texts come) is data of its commands and
of its `LinkWatch`, never code.
"""

from __future__ import annotations

BLIND_SILENCE_S = 0.25
"""A silence, or a time in which our thread did not look, of this length: the safety pilot may have taken over in it. No
command leaves, neither first nor again, until what it changes was received again. Setpoints stop after the same time
(`ual_daemon.flight.setpoint_sender`). Where data come more slowly, a command leaves with one of them."""
CATCH_UP_S = 0.1
"""After such a time of not looking, what waited unread is read within this time."""
READER_PAUSE_S = 1.0
"""Seconds without a look, or the limit of a lost link where that is shorter, after which known and unread data is old,
and is discarded. PX4 may have left OFFBOARD meanwhile, and a setpoint would take it back there.
"""
PAUSE_GRACE_S = 2.0
"""After a pause the autopilot is not blamed for this long for what is missing."""
RESTART_SILENCE_S = 3.0
"""After a silence of this length everything is requested again: the autopilot may have booted, or be another one."""
UNSENT_COMMAND_S = 4.5
"""Seconds after which a command that could not leave is dropped. Shorter than `COMMAND_PATIENCE_S` of
`ual_daemon.flight`, so that the reason is reported.
"""
TEMPORARY_REFUSAL_S = 2.0
"""Seconds for which a command waits that lacks something of the autopilot's (the position of home)."""
SETPOINTS_WAIT_S = 3.0
"""A command that needs setpoints is sent after this even without them, so that the autopilot says what is wrong."""
OWN_MODE_S = 2.0
"""Seconds for which the mode of our command before may be seen first. A PX4 shows a mode within 1 s."""
