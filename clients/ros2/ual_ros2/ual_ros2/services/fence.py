"""Upload of an autopilot's fence, in ROS. It needs no ROS: requests are known by their fields."""

from __future__ import annotations

import asyncio

import ual
from ual import fences
from ual.fences import FencePlan
from ual_ros2.derived.values import kept_fence_fields, read_fence_zone, read_rally_point
from ual_ros2.messages import Message
from ual_ros2.services.fields import Fields, read_all


async def upload(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves UploadFence."""
    plan = await _plan(request)
    kept = await uav.fence.upload(plan, replace=request.replace, enable=not request.is_only_kept, force=request.force)
    return {"fence": kept_fence_fields(kept)}


async def enable(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves EnableFence."""
    return {"fence": kept_fence_fields(await (uav.fence.enable() if request.enable else uav.fence.disable()))}


async def _plan(request: Message) -> FencePlan | None:
    """Reads what is to be uploaded; None is the polygon of UAL's own geofence.

    Raises:
        InvalidArgumentError: It is said in two ways, or the file is none.

    """
    said = [bool(request.file), bool(request.zones or request.rally_points), request.is_configured]
    if sum(said) > 1:
        text = "file: give one of a file, zones with rally points, and is_configured"
        raise ual.InvalidArgumentError(text, {"field": "file"})
    if request.is_configured:
        return None
    if request.file:
        return await asyncio.to_thread(fences.parse, request.file, "file")
    zones = tuple(read_all(read_fence_zone, request.zones, "zones"))
    return FencePlan(zones, tuple(read_all(read_rally_point, request.rally_points, "rally_points")))
