"""The calls of the services beside that of the UAV: what a caller gets wrong is named before anything is sent."""

from __future__ import annotations

from typing import Any

import pytest

from ual._service_calls import gripper, parameters, simulation
from ual.errors import InvalidArgumentError
from ual.gripper import WinchAction
from ual.simulation import MotorsWeak


@pytest.mark.parametrize(
    ("field", "wrong"), [("winch", 7), ("length_m", "far"), ("rate_m_s", [1.0]), ("action", "LENGTH")]
)
def test_the_argument_at_fault_is_named(field: str, wrong: object) -> None:
    arguments: dict[str, Any] = {"action": WinchAction.LENGTH, "winch": "hook", "length_m": 2.0, "rate_m_s": 1.0}
    assert "length_m: 2" in str(gripper.order_winch(**arguments).request)
    with pytest.raises(InvalidArgumentError, match=rf"^{field}: ") as raised:
        gripper.order_winch(**arguments | {field: wrong})
    assert raised.value.metadata == {"field": field}


@pytest.mark.parametrize(("name", "wrong"), [(b"MPC_XY_VEL_MAX", False), ("MPC_XY_VEL_MAX", "no")])
def test_a_text_and_a_switch_that_protobuf_would_take_for_one_are_refused(name: Any, wrong: Any) -> None:
    field = "name" if isinstance(name, bytes) else "force"
    with pytest.raises(InvalidArgumentError, match=rf"^{field}: ") as raised:
        parameters.set_(name, 5.0, wrong)
    assert raised.value.metadata == {"field": field}


def test_a_fault_that_is_none_and_a_part_of_it_that_is_wrong_are_named() -> None:
    for wrong in ("link lost", MotorsWeak("half")):  # type: ignore[arg-type]
        with pytest.raises(InvalidArgumentError, match=r"^fault: "):
            simulation.begin_fault(wrong, 0.0)  # type: ignore[arg-type]
