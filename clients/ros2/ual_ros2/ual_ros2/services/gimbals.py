"""Attitudes of a UAV's gimbals, in ROS. It needs no ROS: requests are known by their fields."""

from __future__ import annotations

import ual
from ual.gimbals import GimbalStatus
from ual_ros2.derived.values import gimbal_status_fields
from ual_ros2.messages import Message
from ual_ros2.services.fields import Fields, stamp


async def get_status(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves GetGimbalStatus."""
    return {"status": status_fields(uav.ns, request.gimbal, await uav.gimbals[request.gimbal].status())}


async def get_statuses(uav: ual.aio.Uav) -> list[Fields]:
    """Returns the status of each gimbal that is heard, for a topic."""
    heard = [each.number for each in await uav.gimbals.get_all() if each.is_connected]
    return [status_fields(uav.ns, number, await uav.gimbals[number].status()) for number in heard]


def status_fields(ns: str, number: int, status: GimbalStatus) -> Fields:
    """Returns a GimbalStatus of the gimbal of a number."""
    header = {"frame_id": f"{ns}/base_link", "stamp": stamp(status.stamp_s)}
    return {"header": header, "gimbal": number, **gimbal_status_fields(status)}
