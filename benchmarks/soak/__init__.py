"""Loads daemons for hours with all that callers do, and shows whether memory grows: ``python -m benchmarks.soak``.

Two real daemons run, one with the light backend and one with the mavlink backend and the PX4-like test autopilot, both
in real time. One program flies both again and again, and disturbs both all the time.
"""
