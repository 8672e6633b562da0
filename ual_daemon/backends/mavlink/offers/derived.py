"""Services that are offered by modules that nothing else names. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from ual_daemon.backends.mavlink.offers import gripper, parachute
from ual_daemon.backends.mavlink.offers.protocol_access import Orders


def offers(orders: Orders) -> tuple[object, ...]:
    """Returns what is offered."""
    return (
        gripper.make_driver(orders),
        parachute.make_driver(orders),
    )
