"""Requests of the client about missions, and its refusals before."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pytest

from ual._service_calls import mission
from ual.errors import InvalidArgumentError, ResourceExhaustedError
from ual.missions import Item, Waypoint, checks


@pytest.mark.parametrize("first", [0, -1])
def test_a_start_with_no_item_is_not_sent(first: int) -> None:
    """On the wire 0 is what was not given, and begins with the first item."""
    with pytest.raises(InvalidArgumentError, match="first_item"):
        mission.start(first, None)


@pytest.mark.parametrize("call", [mission.plan, mission.upload])
def test_too_many_items_are_refused_before_any_of_them_is_looked_at(call: Callable[[Sequence[Item]], object]) -> None:
    many: list[Item] = [Waypoint(37.4, -6.0, 20.0)] * 200_000
    many[0] = "no item"  # type: ignore[call-overload]  # on purpose
    with pytest.raises(ResourceExhaustedError, match=f"200000 are more than the limit of {checks.MOST_ITEMS}"):
        call(many)
