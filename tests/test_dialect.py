"""The messages and constants of MAVLink are what `make dialect` writes."""

from __future__ import annotations

import pymavlink
import pytest
from pymavlink.dialects.v20 import all as mavlink

from tools.dialect import DIALECT, source
from ual_daemon.backends.mavlink.wire import dialect
from ual_daemon.backends.mavlink.wire.messages import member_name


def test_the_committed_module_is_what_is_written() -> None:
    text = DIALECT.read_text()
    if f"Of pymavlink {pymavlink.__version__}," not in text:
        pytest.skip("written with another pymavlink than this")
    assert source() == text, "run make dialect"


def test_each_constant_is_pymavlinks() -> None:
    numbers = {name: value for name, value in vars(dialect).items() if isinstance(value, int)}
    assert len(numbers) > 900
    newer = {"MAVLINK_MSG_ID_COMPONENT_METADATA", "MAVLINK_MSG_ID_EVENT"}
    assert {name: getattr(mavlink, name, None) for name in numbers.keys() - newer}.items() <= numbers.items()


@pytest.mark.parametrize("enum", ["MAV_AUTOPILOT", "MAV_CMD", "MAV_PARAM_ERROR", "MAV_RESULT", "MAV_TYPE"])
def test_each_member_has_its_name(enum: str) -> None:
    for number, entry in mavlink.enums[enum].items():
        if not entry.name.endswith("_ENUM_END"):
            assert f"{enum}_{member_name(enum, number)}" == entry.name
    assert member_name(enum, 12_345_678) is None
