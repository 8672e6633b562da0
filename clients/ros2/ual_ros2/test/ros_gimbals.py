"""Gimbals by the services of the node."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

from flying import Client, each_of
from geometry_msgs.msg import PointStamped
from ual_msgs import srv
from ual_msgs.msg import GimbalStatus as GimbalStatusMessage

import ual
from ual.geometry import stamped_point
from ual.gimbals import (
    AngleRange,
    GimbalAbility,
    GimbalActivity,
    GimbalAngles,
    GimbalControl,
    GimbalInfo,
    GimbalReference,
    GimbalStatus,
)
from ual.interface import Gimbal, Gimbals
from ual_ros2 import values

Call = Callable[..., Any]


class RosGimbals(Gimbals):
    """All of them."""

    def __init__(self, client: Client, ns: str, call: Call) -> None:
        self._client = client
        self._topic = f"/{ns}/ual/gimbals"
        self._call = call

    def get_all(self) -> list[GimbalInfo]:
        return [_info(each) for each in self._call(srv.ListGimbals, "list_gimbals").gimbals]

    def __getitem__(self, number: int) -> RosGimbal:
        return RosGimbal(self._client, self._topic, self._call, number)

    def __iter__(self) -> Iterator[RosGimbal]:
        return (self[each.number] for each in self.get_all())


class RosGimbal(Gimbal):
    """One of them."""

    def __init__(self, client: Client, topic: str, call: Call, number: int) -> None:
        self._client = client
        self._topic = topic
        self._call = call
        self._number = number

    def status(self) -> GimbalStatus:
        return status_of(self._call(srv.GetGimbalStatus, "get_gimbal_status", gimbal=self._number).status)

    def watch(self, rate_hz: float = 10.0) -> Iterator[GimbalStatus]:
        """The topic has a rate of its own."""
        for told in each_of(self._client.hear(GimbalStatusMessage, self._topic, 10)):
            if told.gimbal == self._number:
                yield status_of(told)

    def set_angles(
        self,
        pitch_rad: float,
        yaw_rad: float = 0.0,
        roll_rad: float = 0.0,
        *,
        reference: GimbalReference = GimbalReference.HORIZON,
        frame_id: str = "",
    ) -> None:
        angles = {"roll": roll_rad, "pitch": pitch_rad, "yaw": yaw_rad}
        more = {"reference": reference.name, "frame_id": frame_id}
        self._call(srv.SetGimbalAngles, "set_gimbal_angles", gimbal=self._number, **angles, **more)

    def set_rates(self, pitch_rad_s: float, yaw_rad_s: float = 0.0) -> None:
        self._call(srv.SetGimbalRates, "set_gimbal_rates", gimbal=self._number, pitch=pitch_rad_s, yaw=yaw_rad_s)

    def point_at(self, point: ual.PointStamped | ual.Vector3) -> None:
        stamped, message = stamped_point(point), PointStamped()
        message.header.frame_id = stamped.frame_id
        values.fill_vector(message.point, stamped.point)
        self._call(srv.PointGimbal, "point_gimbal", gimbal=self._number, point=message)

    def move_to_neutral(self) -> None:
        self._order("move_gimbal_to_neutral")

    def retract(self) -> None:
        self._order("retract_gimbal")

    def take_control(self) -> None:
        self._order("take_gimbal_control")

    def release_control(self) -> None:
        self._order("release_gimbal_control")

    def _order(self, name: str) -> None:
        self._call(srv.OrderGimbal, name, gimbal=self._number)


def _info(message: Any) -> GimbalInfo:
    return GimbalInfo(
        message.number,
        message.name,
        frozenset(GimbalAbility[each] for each in message.abilities),
        message.is_connected,
        message.frame_id,
        _limits(message.roll),
        _limits(message.pitch),
        _limits(message.yaw),
        message.note,
    )


def _limits(told: Any) -> AngleRange | None:
    least, most = map(float, told)
    return None if math.isnan(least) else AngleRange(least, most)


def status_of(message: Any) -> GimbalStatus:
    """The status that a message tells."""
    stamp = message.header.stamp
    is_known = not math.isnan(message.pitch)
    return GimbalStatus(
        stamp.sec + stamp.nanosec / values.NANO or None,
        GimbalAngles(message.roll, message.pitch, message.yaw) if is_known else None,
        _orientation(message.in_body),
        _orientation(message.in_odom),
        GimbalActivity[message.activity] if message.activity else None,
        values.point_stamped(message.target) if message.target.header.frame_id else None,
        None if math.isnan(message.off_target) else message.off_target,
        GimbalControl[message.control] if message.control else None,
        message.controller,
        tuple(message.problems),
    )


def _orientation(message: Any) -> ual.Quaternion | None:
    found = values.quaternion(message)
    return found if found.norm() else None
