"""The extension: the gimbal in the daemon, and its service."""

from __future__ import annotations

import asyncio
import math
import threading
from collections.abc import AsyncIterator, Iterator, Sequence
from concurrent.futures import CancelledError, Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from functools import partial
from typing import Literal

from typing_extensions import override

from ual.access.roles import Role
from ual.errors import InvalidArgumentError, TaskAbortedError, UalError, UalTimeoutError, WrongStateError
from ual.geometry import PointStamped, Vector3, wrap_angle
from ual.interface import Uav
from ual_daemon.extensions import Extension, ExtensionContext
from ual_daemon.extensions.base import Service
from ual_daemon.settings import ConfigError, Settings
from ual_gimbal.device import Device, MavlinkDevice, SimulatedDevice
from ual_gimbal.interface import Attitude, Gimbal
from ual_gimbal.v1 import gimbal_pb2 as pb
from ual_gimbal.v1 import gimbal_pb2_grpc

_FOLLOW_S = 0.1
_ACCEPT_S = 3.0
_HIGHEST_RATE_HZ = 50.0


class GimbalSettings(Settings, frozen=True, kw_only=True):
    """The section ``extensions.gimbal`` of the configuration."""

    device: Literal["auto", "mavlink", "simulated"] = "auto"
    speed_rad_s: float = 1.5
    lowest_pitch_rad: float = -math.pi / 2.0
    highest_pitch_rad: float = math.pi / 6.0


def direction(uav: Uav, point: PointStamped) -> Attitude:
    """Returns where a gimbal has to point to see a position, from where the UAV is now.

    Raises:
        UnknownFrameError: There is no such frame.
        WrongStateError: The position of the UAV, or of the frame, is not known.

    """
    seen = uav.pose()
    target = uav.transform(seen.frame_id, point.frame_id or f"{uav.ns}/odom").apply(point.point)
    way = target - seen.pose.position
    if way.norm() == 0.0:
        return Attitude(0.0, 0.0)
    yaw_rad = math.atan2(way.y, way.x) if way.horizontal_norm() > 0.0 else seen.pose.yaw_rad
    return Attitude(math.atan2(way.z, way.horizontal_norm()), wrap_angle(yaw_rad - seen.pose.yaw_rad))


class FollowingGimbal(Gimbal):
    """The gimbal in the daemon's process. Any thread may call."""

    def __init__(self, uav: Uav, device: Device, settings: GimbalSettings) -> None:
        self._uav = uav
        self._device = device
        self._settings = settings
        self._target: PointStamped | None = None

    @override
    def attitude(self) -> Attitude:
        return self._device.attitude()

    @override
    def watch(self, rate_hz: float = 10.0) -> Iterator[Attitude]:
        never = threading.Event()
        while True:
            yield self.attitude()
            never.wait(1.0 / rate_hz)

    @override
    def point(self, pitch_rad: float, yaw_rad: float) -> None:
        sent = self.begin(Attitude(pitch_rad, yaw_rad))
        try:
            sent.result(_ACCEPT_S)
        except FutureTimeoutError:
            raise not_accepted(sent) from None
        except CancelledError:
            raise replaced() from None

    @override
    def point_at(self, point: PointStamped) -> None:
        direction(self._uav, point)  # refused now, not silently later
        self._target = point
        self.follow()

    def begin(self, goal: Attitude) -> Future[None]:
        """Begins to point in a direction. Raises as `point` does."""
        s = self._settings
        if not s.lowest_pitch_rad <= goal.pitch_rad <= s.highest_pitch_rad:  # also NaN
            limits = f"{s.lowest_pitch_rad:.2f} to {s.highest_pitch_rad:.2f} rad"
            raise InvalidArgumentError(f"pitch_rad: {goal.pitch_rad:g} is not {limits}", {"field": "pitch_rad"})
        if not abs(goal.yaw_rad) <= math.pi:
            raise InvalidArgumentError(f"yaw_rad: {goal.yaw_rad:g} is not within a half turn", {"field": "yaw_rad"})
        self._target = None
        return self._device.point(goal)

    def follow(self) -> None:
        """Points at the target, if there is one, as far as the gimbal can."""
        target = self._target
        if target is None:
            return
        try:
            seen = direction(self._uav, target)
        except UalError:  # the position is lost for a while: it stays as it is
            return
        s = self._settings
        pitch_rad = min(max(seen.pitch_rad, s.lowest_pitch_rad), s.highest_pitch_rad)
        self._device.point(Attitude(pitch_rad, seen.yaw_rad))


class GimbalServicer(gimbal_pb2_grpc.GimbalServiceServicer):
    """The service: coroutines on the daemon's event loop, so nothing here blocks."""

    def __init__(self, gimbal: FollowingGimbal) -> None:
        self._gimbal = gimbal

    @override
    async def GetAttitude(self, request: pb.GetAttitudeRequest, context: object) -> pb.GetAttitudeResponse:
        return pb.GetAttitudeResponse(attitude=_to_proto(self._gimbal.attitude()))

    @override
    async def WatchAttitude(
        self, request: pb.WatchAttitudeRequest, context: object
    ) -> AsyncIterator[pb.WatchAttitudeResponse]:
        if not 0.0 <= request.rate_hz <= _HIGHEST_RATE_HZ:
            raise InvalidArgumentError(f"rate_hz: {request.rate_hz:g} is not 0 to 50 Hz", {"field": "rate_hz"})
        while True:
            yield pb.WatchAttitudeResponse(attitude=_to_proto(self._gimbal.attitude()))
            await asyncio.sleep(1.0 / (request.rate_hz or 10.0))

    @override
    async def Point(self, request: pb.PointRequest, context: object) -> pb.PointResponse:
        sent = self._gimbal.begin(Attitude(request.attitude.pitch_rad, request.attitude.yaw_rad))
        try:
            await asyncio.wait_for(asyncio.wrap_future(sent), _ACCEPT_S)
        except asyncio.TimeoutError:
            raise not_accepted(sent) from None
        except asyncio.CancelledError:
            if not sent.cancelled():
                raise
            raise replaced() from None
        return pb.PointResponse()

    @override
    async def PointAt(self, request: pb.PointAtRequest, context: object) -> pb.PointAtResponse:
        point = Vector3(request.x_m, request.y_m, request.z_m)
        self._gimbal.point_at(PointStamped(point, request.frame_id))
        return pb.PointAtResponse()


class GimbalExtension(Extension):
    """The gimbal of one UAV."""

    def __init__(self, context: ExtensionContext) -> None:
        settings = context.settings_as(GimbalSettings)
        self._device = _device(context, settings)
        self._gimbal = FollowingGimbal(context.uav, self._device, settings)
        self._is_closed = threading.Event()
        self._thread = threading.Thread(target=self._follow, name=f"gimbal of {context.uav.ns}", daemon=True)

    @property
    @override
    def services(self) -> Sequence[Service]:
        add = partial(gimbal_pb2_grpc.add_GimbalServiceServicer_to_server, GimbalServicer(self._gimbal))
        reading = {"GetAttitude": Role.OBSERVER, "WatchAttitude": Role.OBSERVER}
        return [Service("ual_gimbal.v1.GimbalService", add, reading)]

    @property
    @override
    def interface(self) -> Gimbal:
        return self._gimbal

    @override
    def start(self) -> None:
        self._device.start()
        self._thread.start()

    @override
    def close(self) -> None:
        self._is_closed.set()
        self._device.close()
        if self._thread.is_alive():
            self._thread.join()

    def _follow(self) -> None:
        while not self._is_closed.wait(_FOLLOW_S):
            self._gimbal.follow()


def _device(context: ExtensionContext, settings: GimbalSettings) -> Device:
    if settings.device == "simulated" or (settings.device == "auto" and context.payload is None):
        return SimulatedDevice(settings.speed_rad_s)
    if context.payload is None:
        raise ConfigError("this backend sends no commands to a gimbal, or this daemon only watches", "device")
    return MavlinkDevice(context.payload, partial(_heading_rad, context.uav))


def _heading_rad(uav: Uav) -> float:
    try:
        return uav.pose().pose.yaw_rad
    except WrongStateError:
        return math.nan


def not_accepted(sent: Future[None]) -> UalTimeoutError:
    """Gives up a command, and returns the error for it."""
    sent.cancel()
    return UalTimeoutError(f"the autopilot did not acknowledge the gimbal's command within {_ACCEPT_S:g} s")


def replaced() -> TaskAbortedError:
    """The error of a command that a newer one has replaced before it was acknowledged."""
    return TaskAbortedError("point: replaced by a newer command", {"by": "point"})


def _to_proto(attitude: Attitude) -> pb.Attitude:
    return pb.Attitude(pitch_rad=attitude.pitch_rad, yaw_rad=attitude.yaw_rad)
