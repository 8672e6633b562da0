"""Services that are offered by modules that nothing else names. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Callable

from ual_daemon.backends.light import gripper, parachute


def offers(clock: Callable[[], float], is_link_lost: Callable[[], bool]) -> tuple[object, ...]:
    """Returns what is offered."""
    return (
        gripper.make_driver(clock, is_link_lost),
        parachute.make_driver(clock, is_link_lost),
    )
