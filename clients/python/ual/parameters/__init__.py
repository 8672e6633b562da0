"""The parameters of an autopilot: values and files. `ual.Uav.parameters` reads and writes them on a UAV."""

from __future__ import annotations

from ual.parameters.files import Difference, FileValues, OtherComponent, compare, read, write
from ual.parameters.values import SYSTEM_ID_NAMES, Description, Parameter, ParameterType, range_text

__all__ = [
    "SYSTEM_ID_NAMES",
    "Description",
    "Difference",
    "FileValues",
    "OtherComponent",
    "Parameter",
    "ParameterType",
    "compare",
    "range_text",
    "read",
    "write",
]
