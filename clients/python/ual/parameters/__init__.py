"""The parameters of an autopilot: values and files. `ual.Uav.parameters` reads and writes them on a UAV."""

from __future__ import annotations

from ual.parameters.files import Difference, compare, read, write
from ual.parameters.values import Parameter, ParameterType

__all__ = ["Difference", "Parameter", "ParameterType", "compare", "read", "write"]
