"""What the client sends of missions, and what it refuses before."""

from __future__ import annotations

import pytest

from ual import _mission_calls
from ual.errors import InvalidArgumentError


@pytest.mark.parametrize("first", [0, -1])
def test_a_start_with_no_item_is_not_sent(first: int) -> None:
    """On the wire 0 is what was not given, and begins with the first item."""
    with pytest.raises(InvalidArgumentError, match="first_item"):
        _mission_calls.start(first, None)
