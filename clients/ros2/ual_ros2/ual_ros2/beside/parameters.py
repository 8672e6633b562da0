"""The autopilot's parameters in ROS. It needs no ROS: requests are known by their fields."""

from __future__ import annotations

import ual
from ual.parameters.values import Parameter
from ual_ros2 import values
from ual_ros2.beside.fields import Fields
from ual_ros2.messages import Message


async def get(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves GetParameter."""
    return {"parameter": parameter_fields(await uav.parameters.get(request.name))}


async def list_all(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves ListParameters."""
    return {"parameters": [parameter_fields(each) for each in await uav.parameters.get_all()]}


async def write(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves SetParameter."""
    return {"parameter": parameter_fields(await uav.parameters.set(request.name, request.value, force=request.force))}


def parameter_fields(read: Parameter) -> Fields:
    """Returns a Parameter."""
    return {
        "name": read.name,
        "value": float(read.value),
        "type": read.type.name,
        "is_relied_on": read.is_relied_on,
        "minimum": values.known(read.minimum),
        "maximum": values.known(read.maximum),
        "unit": read.unit,
        "description": read.description,
        "needs_reboot": read.needs_reboot,
    }
