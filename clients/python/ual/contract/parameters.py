"""The parameters of the autopilot: its own numbers, by its own names. As values, from ``parameters.proto``.

``make proto`` writes this file: do not edit it.
"""

from __future__ import annotations

from dataclasses import dataclass

from ual.contract._bases import ParameterBase, ParameterTypeBase


class ParameterType(ParameterTypeBase):
    """Type in which the autopilot keeps a parameter. The numbers are those of MAVLink's MAV_PARAM_TYPE."""

    UINT8 = 1
    INT8 = 2
    UINT16 = 3
    INT16 = 4
    UINT32 = 5
    INT32 = 6
    REAL32 = 9


@dataclass(frozen=True, slots=True)
class Parameter(ParameterBase):
    """One parameter of the autopilot.

    Args:
        name: The autopilot's own name, such as MPC_XY_CRUISE.
        value: In the autopilot's own unit, and exact: whole where its type is.
        type: How the autopilot keeps it.
        is_relied_on: Whether a flight relies on it: it cannot be written while the UAV is armed.
        minimum: The least value that it should have, by the autopilot's own description. None where it describes none.
        maximum: The largest one.
        unit: Such as m/s. Empty where the autopilot does not say.
        description: What it is, in one line of the autopilot's own words. Empty where it does not say.
        needs_reboot: Whether it takes effect at the next boot, by the autopilot's own description.

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
