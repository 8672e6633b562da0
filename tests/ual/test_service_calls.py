"""The calls of the services beside that of the UAV: what a caller gets wrong is named before anything is sent."""

from __future__ import annotations

from typing import Any

import pytest

from ual._service_calls import gripper
from ual.errors import InvalidArgumentError
from ual.gripper import WinchAction


@pytest.mark.parametrize(
    ("field", "wrong"), [("winch", 7), ("length_m", "far"), ("rate_m_s", [1.0]), ("action", "LENGTH")]
)
def test_the_argument_at_fault_is_named(field: str, wrong: object) -> None:
    arguments: dict[str, Any] = {"action": WinchAction.LENGTH, "winch": "hook", "length_m": 2.0, "rate_m_s": 1.0}
    assert "length_m: 2" in str(gripper.order_winch(**arguments).request)
    with pytest.raises(InvalidArgumentError, match=rf"^{field}: ") as raised:
        gripper.order_winch(**arguments | {field: wrong})
    assert raised.value.metadata == {"field": field}
