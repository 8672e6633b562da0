"""The parameters of an autopilot: values and files. `ual.Uav.parameters` reads and writes them on a UAV."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ual.parameters.values import SYSTEM_ID_NAMES, Description, Parameter, ParameterType, range_text
from ual.shared.late import late

if TYPE_CHECKING:
    from ual.parameters.files import Difference, FileValues, OtherComponent, compare, read, write

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

if not TYPE_CHECKING:  # a type checker would take any name for one of ours
    __getattr__ = late(
        "ual.parameters", "files", "Difference", "FileValues", "OtherComponent", "compare", "read", "write"
    )
