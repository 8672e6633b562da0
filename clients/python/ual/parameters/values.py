"""One parameter of an autopilot, and how its value is written."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from enum import Enum

_REAL32_DIGITS = range(6, 10)
"""Nine significant digits tell any two numbers of 32 bits apart; mostly fewer do."""


SYSTEM_ID_NAMES = frozenset({"MAV_SYS_ID", "SYSID_THISMAV", "MAV_SYSID"})
"""Names of the parameter by which a MAVLink autopilot becomes another system: of PX4, of ArduPilot, and from 4.7 on."""


class ParameterType(Enum):
    """How the autopilot keeps a parameter. The numbers are those of MAVLink's MAV_PARAM_TYPE."""

    UINT8 = 1
    INT8 = 2
    UINT16 = 3
    INT16 = 4
    UINT32 = 5
    INT32 = 6
    REAL32 = 9

    @property
    def is_whole(self) -> bool:
        """Whether its values are integers."""
        return self is not ParameterType.REAL32

    @property
    def limits(self) -> tuple[float, float]:
        """The least and the largest value."""
        return _LIMITS[self]


_LARGEST_REAL32: float = struct.unpack("<f", b"\xff\xff\x7f\x7f")[0]
_LIMITS: dict[ParameterType, tuple[float, float]] = {
    ParameterType.UINT8: (0, 2**8 - 1),
    ParameterType.INT8: (-(2**7), 2**7 - 1),
    ParameterType.UINT16: (0, 2**16 - 1),
    ParameterType.INT16: (-(2**15), 2**15 - 1),
    ParameterType.UINT32: (0, 2**32 - 1),
    ParameterType.INT32: (-(2**31), 2**31 - 1),
    ParameterType.REAL32: (-_LARGEST_REAL32, _LARGEST_REAL32),
}


@dataclass(frozen=True, slots=True)
class Description:
    """What the autopilot tells about a parameter.

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


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of the autopilot, as it was read.

    Args:
        name: The autopilot's own name.
        value: In the autopilot's own unit: an int for a whole type, else a float.
        type: How the autopilot keeps it.
        is_relied_on: Whether a flight relies on it: it cannot be written while the UAV is armed.
        minimum: The least value that it should have; None where the autopilot does not say.
        maximum: The largest one.
        unit: Such as ``m/s``; empty where the autopilot does not say.
        description: What it is, in one line of the autopilot's own words; empty where it does not say.
        needs_reboot: Whether it takes effect at the next boot, as far as the autopilot says.

    """

    name: str
    value: float
    type: ParameterType
    is_relied_on: bool = False
    minimum: float | None = None
    maximum: float | None = None
    unit: str = ""
    description: str = ""
    needs_reboot: bool = False

    @property
    def text(self) -> str:
        """The value, as short as it can be written without becoming another one."""
        return str(int(self.value)) if self.type.is_whole else real32_text(self.value)


def range_text(parameter: Parameter) -> str:
    """Returns the range of a parameter, human-readable, with its unit; empty where none is known."""
    low, high = (None if each is None else f"{each:.7g}" for each in (parameter.minimum, parameter.maximum))
    if low is None and high is None:
        return ""
    limits = f"up to {high}" if low is None else f"from {low}" if high is None else f"{low} to {high}"
    return f"{limits} {parameter.unit}".rstrip()


def real32(value: float) -> float:
    """Returns the number of 32 bits that is next to this one. Infinite where it is too large."""
    try:
        nearest: float = struct.unpack("<f", struct.pack("<f", value))[0]
    except OverflowError:
        return math.copysign(math.inf, value)
    return nearest


def real32_text(value: float) -> str:
    """Returns the shortest text of which `real32` makes the same number."""
    if not math.isfinite(value):
        return str(value)
    texts = (f"{value:.{digits}g}" for digits in _REAL32_DIGITS)
    return next((text for text in texts if real32(float(text)) == real32(value)), repr(value))


def is_same(parameter: Parameter, value: float) -> bool:
    """Whether a value, as written by hand or in a file, is that of a parameter."""
    return is_equal(parameter.value, value if parameter.type.is_whole else real32(value))


def is_equal(one: float, other: float) -> bool:
    """Whether two values are the same; NaN is the same as NaN."""
    return one == other or (math.isnan(one) and math.isnan(other))
