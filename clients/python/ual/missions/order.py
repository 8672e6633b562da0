"""Order in which the items of a mission are executed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from ual.errors import ResourceExhaustedError
from ual.missions.items import Item, Jump

MOST_STEPS = 20_000
"""Most items that a mission may execute, with those that jumps repeat."""


def executed(items: Sequence[Item], start: int = 0) -> list[int]:
    """Returns the indices of the items in the order in which they are executed, without the jumps.

    Both autopilots count each jump over the whole mission: one that has been made as often as it says goes on.

    Raises:
        ResourceExhaustedError: The jumps repeat more than `MOST_STEPS` items.

    """
    order: list[int] = []
    made: Counter[int] = Counter()
    index = start
    while index < len(items):
        item = items[index]
        if not isinstance(item, Jump):
            order.append(index)
            index += 1
        elif made[index] < item.times:
            made[index] += 1
            index = item.to - 1
        else:
            index += 1
        if len(order) + made.total() > MOST_STEPS:
            raise ResourceExhaustedError(
                f"items: the mission executes more than {MOST_STEPS} of them: jump fewer times",
                {"field": "items", "limit": str(MOST_STEPS)},
            )
    return order
