"""The world around a simulated UAV in ROS. It needs no ROS: requests are known by their fields."""

from __future__ import annotations

import ual
from ual_ros2.derived.values import fault_fields
from ual_ros2.messages import Message
from ual_ros2.services.fields import Fields


async def is_available(uav: ual.aio.Uav, info: ual.Info) -> bool:
    """Returns whether the daemon offers its simulation. That of a real UAV is not asked, as its info says so.

    A simulated UAV need not have one to offer: that of an autopilot's own simulator does not.
    """
    if not info.is_simulation:
        return False
    try:
        await uav.simulation.parts()
    except ual.UalError:  # a daemon that has ended meanwhile is asked again by the next connection
        return False
    return True


async def list_faults(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves ListFaults."""
    found = await uav.simulation.faults()
    return {"faults": [{"fault_id": fault_id, **fault_fields(each)} for fault_id, each in found.items()]}
