"""The fence and the rally points of an autopilot in ROS. It needs no ROS: requests are known by their fields."""

from __future__ import annotations

import asyncio

import ual
from ual import fences
from ual.fences import FencePlan, FenceZone, KeptFence, RallyPoint
from ual_ros2.beside.fields import Fields, place
from ual_ros2.messages import Message


async def get(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves GetFence."""
    return _told(await uav.fence.get())


async def upload(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves UploadFence."""
    plan = await _plan(request)
    kept = await uav.fence.upload(plan, replace=request.replace, enable=not request.is_only_kept, force=request.force)
    return _told(kept)


async def clear(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves ClearFence."""
    return _told(await uav.fence.clear(with_rally_points=request.with_rally_points, force=request.force))


async def enable(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves EnableFence."""
    return _told(await (uav.fence.enable() if request.enable else uav.fence.disable()))


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
    return FencePlan(tuple(map(zone, request.zones)), tuple(map(rally_point, request.rally_points)))


def zone(message: Message) -> FenceZone:
    """Reads a FenceZone."""
    points = tuple((each.latitude, each.longitude) for each in message.points)
    return FenceZone(message.is_inclusion, points, None if message.radius == 0.0 else message.radius)


def rally_point(message: Message) -> RallyPoint:
    """Reads a RallyPoint."""
    reference = ual.AltitudeReference.AMSL if message.is_amsl else ual.AltitudeReference.HOME
    return RallyPoint(message.place.latitude, message.place.longitude, message.height, reference)


def _told(kept: KeptFence) -> Fields:
    return {"fence": kept_fields(kept)}


def kept_fields(kept: KeptFence) -> Fields:
    """Returns a KeptFence."""
    return {
        "zones": [_zone_fields(each) for each in kept.zones],
        "rally_points": [_rally_fields(each) for each in kept.rally_points],
        "is_enabled": bool(kept.is_enabled),
        "is_enabled_known": kept.is_enabled is not None,
        "return_point": [] if kept.return_point is None else [place(*kept.return_point)],
    }


def _zone_fields(found: FenceZone) -> Fields:
    points = [place(*each) for each in found.points]
    return {"is_inclusion": found.is_inclusion, "points": points, "radius": found.radius_m or 0.0}


def _rally_fields(found: RallyPoint) -> Fields:
    return {
        "place": place(found.latitude_deg, found.longitude_deg),
        "height": found.height_m,
        "is_amsl": found.reference is ual.AltitudeReference.AMSL,
    }
