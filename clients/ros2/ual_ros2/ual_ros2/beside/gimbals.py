"""The gimbals of a UAV in ROS. It needs no ROS: requests are known by their fields."""

from __future__ import annotations

from collections.abc import Awaitable

import ual
from ual.gimbals import AngleRange, GimbalInfo, GimbalReference, GimbalStatus
from ual_ros2 import values
from ual_ros2.beside.fields import NEVER, Fields, Stamp, name_of, named, names_of, quaternion, vector
from ual_ros2.messages import Message


async def list_all(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves ListGimbals."""
    return {"gimbals": [info_fields(each) for each in await uav.gimbals.get_all()]}


async def get_status(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves GetGimbalStatus."""
    return {"status": status_fields(uav.ns, request.gimbal, await uav.gimbals[request.gimbal].status())}


async def get_statuses(uav: ual.aio.Uav) -> list[Fields]:
    """Returns the status of each gimbal that is heard, for a topic."""
    heard = [each.number for each in await uav.gimbals.get_all() if each.is_connected]
    return [status_fields(uav.ns, number, await uav.gimbals[number].status()) for number in heard]


def set_angles(uav: ual.aio.Uav, request: Message) -> Awaitable[None]:
    """Serves SetGimbalAngles."""
    reference = named(GimbalReference, request.reference, "reference", GimbalReference.HORIZON)
    return uav.gimbals[request.gimbal].set_angles(
        request.pitch, request.yaw, request.roll, reference=reference, frame_id=request.frame_id
    )


def set_rates(uav: ual.aio.Uav, request: Message) -> Awaitable[None]:
    """Serves SetGimbalRates."""
    return uav.gimbals[request.gimbal].set_rates(request.pitch, request.yaw)


def point(uav: ual.aio.Uav, request: Message) -> Awaitable[None]:
    """Serves PointGimbal."""
    return uav.gimbals[request.gimbal].point_at(values.point_stamped(request.point))


def info_fields(info: GimbalInfo) -> Fields:
    """Returns a Gimbal."""
    return {
        "number": info.number,
        "name": info.name,
        "abilities": names_of(info.abilities),
        "is_connected": info.is_connected,
        "frame_id": info.frame_id,
        "roll": _limits(info.roll),
        "pitch": _limits(info.pitch),
        "yaw": _limits(info.yaw),
        "note": info.note,
    }


def status_fields(ns: str, number: int, status: GimbalStatus) -> Fields:
    """Returns a GimbalStatus."""
    angles = status.angles
    return {
        "header": {"frame_id": f"{ns}/base_link", "stamp": NEVER if status.stamp_s is None else Stamp(status.stamp_s)},
        "gimbal": number,
        "roll": values.known(None if angles is None else angles.roll_rad),
        "pitch": values.known(None if angles is None else angles.pitch_rad),
        "yaw": values.known(None if angles is None else angles.yaw_rad),
        "in_body": quaternion(status.in_body),
        "in_odom": quaternion(status.in_odom),
        "activity": name_of(status.activity),
        "target": _target(status.target),
        "off_target": values.known(status.off_target_rad),
        "control": name_of(status.control),
        "controller": status.controller,
        "problems": list(status.problems),
    }


def _limits(found: AngleRange | None) -> list[float]:
    return [values.known(None)] * 2 if found is None else [found.least_rad, found.most_rad]


def _target(target: ual.PointStamped | None) -> Fields:
    if target is None:
        return {}
    return {"header": {"frame_id": target.frame_id}, "point": vector(target.point)}
