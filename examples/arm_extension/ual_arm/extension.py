"""The extension: the simulated arm in the daemon, its service, and its frames in the tree."""

from __future__ import annotations

import asyncio
import math
import threading
import time
from collections.abc import AsyncIterator, Iterator, Sequence
from functools import partial

from typing_extensions import override

from ual.errors import InvalidArgumentError, TaskAbortedError, UalError
from ual.geometry import Vector3
from ual_arm import wire
from ual_arm.interface import Arm
from ual_arm.servicer import ROLES, ArmServicerBase
from ual_arm.simulation import Joint, Motion, checked, frames
from ual_arm.v1 import arm_pb2 as pb
from ual_arm.v1 import arm_pb2_grpc
from ual_arm.values import Joints
from ual_daemon.extensions import Extension, ExtensionContext, lease_of
from ual_daemon.extensions.base import Service
from ual_daemon.settings import Settings

_FRAMES_S = 0.05
_HIGHEST_RATE_HZ = 50.0


class ArmSettings(Settings, frozen=True, kw_only=True):
    """The section ``extensions.arm`` of the configuration."""

    speed_rad_s: float = 1.0
    limit_rad: float = math.pi / 2.0
    upper_m: float = 0.3
    lower_m: float = 0.25
    mount: tuple[float, float, float] = (0.1, 0.0, -0.1)


class SimulatedArm(Arm):
    """The arm in the daemon's process. Any thread may call."""

    def __init__(self, context: ExtensionContext, settings: ArmSettings) -> None:
        self._context = context
        self._settings = settings
        still = Joint(0.0, 0.0, time.monotonic(), settings.speed_rad_s)
        self._motion = Motion(still, still)
        self._moved = threading.Condition()

    @override
    def joints(self) -> Joints:
        return self._motion.at(time.monotonic())

    @override
    def watch(self, rate_hz: float = 10.0) -> Iterator[Joints]:
        never = threading.Event()
        while True:
            yield self.joints()
            never.wait(1.0 / rate_hz)

    @override
    def move(self, shoulder_rad: float, elbow_rad: float) -> Joints:
        motion = self.begin(shoulder_rad, elbow_rad)
        with self._moved:
            while (left_s := motion.arrives_s - time.monotonic()) > 0.0 and self._motion is motion:
                self._moved.wait(left_s)
        return self.ended(motion)

    def begin(self, shoulder_rad: float, elbow_rad: float, lease_id: str | None = None) -> Motion:
        """Begins to move, by the lease of a call. Raises as `move` does."""
        self._context.require_lease("move_joints", lease_id)
        limit_rad, now_s = self._settings.limit_rad, time.monotonic()
        shoulder = checked(shoulder_rad, limit_rad, "shoulder_rad")
        elbow = checked(elbow_rad, limit_rad, "elbow_rad")
        with self._moved:
            before = self._motion
            self._motion = Motion(before.shoulder.towards(shoulder, now_s), before.elbow.towards(elbow, now_s))
            self._moved.notify_all()
            return self._motion

    def ended(self, motion: Motion) -> Joints:
        """Returns where the joints are after a motion.

        Raises:
            TaskAbortedError: A newer one has replaced it.

        """
        if self._motion is not motion:
            raise TaskAbortedError("move_joints: replaced by a newer movement", {"by": "move_joints"})
        return self.joints()


class ArmServicer(ArmServicerBase):
    """Methods that take time: coroutines on the daemon's event loop, so nothing here blocks."""

    def __init__(self, arm: SimulatedArm) -> None:
        super().__init__(arm)
        self._arm = arm

    @override
    async def WatchJoints(
        self, request: pb.WatchJointsRequest, context: object
    ) -> AsyncIterator[pb.WatchJointsResponse]:
        if not 0.0 <= request.rate_hz <= _HIGHEST_RATE_HZ:
            raise InvalidArgumentError(f"rate_hz: {request.rate_hz:g} is not 0 to 50 Hz", {"field": "rate_hz"})
        while True:
            yield pb.WatchJointsResponse(joints=wire.joints_to_proto(self._arm.joints()))
            await asyncio.sleep(1.0 / (request.rate_hz or 10.0))

    @override
    async def MoveJoints(self, request: pb.MoveJointsRequest, context: object) -> pb.MoveJointsResponse:
        motion = self._arm.begin(request.shoulder_rad, request.elbow_rad, lease_of(context))
        await asyncio.sleep(motion.arrives_s - time.monotonic())
        return pb.MoveJointsResponse(joints=wire.joints_to_proto(self._arm.ended(motion)))


class ArmExtension(Extension):
    """The arm of one UAV."""

    def __init__(self, context: ExtensionContext) -> None:
        self._settings = context.settings_as(ArmSettings)
        self._uav = context.uav
        self._arm = SimulatedArm(context, self._settings)
        self._is_closed = threading.Event()
        self._thread = threading.Thread(target=self._move_frames, name=f"arm of {context.uav.ns}", daemon=True)

    @property
    @override
    def services(self) -> Sequence[Service]:
        add = partial(arm_pb2_grpc.add_ArmServiceServicer_to_server, ArmServicer(self._arm))
        return [Service("ual_arm.v1.ArmService", add, ROLES)]

    @property
    @override
    def interface(self) -> Arm:
        return self._arm

    @override
    def start(self) -> None:
        self._thread.start()

    @override
    def close(self) -> None:
        self._is_closed.set()
        if self._thread.is_alive():
            self._thread.join()

    def _move_frames(self) -> None:
        """Keeps the frames where the joints are: goals in them, as before the tool, go with them."""
        last: Joints | None = None
        while not self._is_closed.wait(_FRAMES_S):
            joints = self._arm.joints()
            if joints != last and self._add_frames(joints):
                last = joints

    def _add_frames(self, joints: Joints) -> bool:
        s = self._settings
        try:
            for transform in frames(self._uav.ns, joints, Vector3(*s.mount), s.upper_m, s.lower_m):
                self._uav.add_frame(transform)
        except UalError:  # logged by the vehicle; tried again
            return False
        return True
