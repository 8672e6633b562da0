"""One parameter of an autopilot, and how its value is written."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ual.contract.parameters import Parameter, ParameterType
from ual.shared.real32 import real32, real32_text

__all__ = [
    "SYSTEM_ID_NAMES",
    "Description",
    "Parameter",
    "ParameterType",
    "is_equal",
    "is_same",
    "range_text",
    "real32",
    "real32_text",
]

SYSTEM_ID_NAMES = frozenset({"MAV_SYS_ID", "SYSID_THISMAV", "MAV_SYSID"})
"""Names of the parameter by which a MAVLink autopilot becomes another system: of PX4, of ArduPilot, and from 4.7 on."""


@dataclass(frozen=True, slots=True)
class Description:
    """Description of a parameter by the autopilot.

    Args:
        minimum: The least value that it should have; None where the autopilot does not say.
        maximum: The largest one.
        unit: Such as ``m/s``.
        text: What it is, in one line.
        needs_reboot: Whether it takes effect at the next boot.
    """

    minimum: float | None = None
    maximum: float | None = None
    unit: str = ""
    text: str = ""
    needs_reboot: bool = False


def range_text(parameter: Parameter) -> str:
    """Returns the range of a parameter, human-readable, with its unit; empty where none is known."""
    low, high = (None if each is None else f"{each:.7g}" for each in (parameter.minimum, parameter.maximum))
    if low is None and high is None:
        return ""
    limits = f"up to {high}" if low is None else f"from {low}" if high is None else f"{low} to {high}"
    return f"{limits} {parameter.unit}".rstrip()


def is_same(parameter: Parameter, value: float) -> bool:
    """Returns whether a value, as written by hand or in a file, is that of a parameter."""
    return is_equal(parameter.value, value if parameter.type.is_whole else real32(value))


def is_equal(one: float, other: float) -> bool:
    """Returns whether two values are the same; NaN is the same as NaN."""
    return one == other or (math.isnan(one) and math.isnan(other))
