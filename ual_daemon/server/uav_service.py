"""`UalService`: unpacks the request, calls the vehicle, packs the response. The vehicle decides what is allowed."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Callable, Generator
from concurrent.futures import Future
from functools import partial
from typing import TYPE_CHECKING, TypeAlias, TypeVar

from typing_extensions import override

from ual.access.roles import Role
from ual.geometry import TwistStamped
from ual.v1 import ual_pb2 as pb
from ual.wire import motions, uav
from ual_daemon import logs, validation
from ual_daemon.extensions.base import lease_of
from ual_daemon.flight.flight import LastCommand
from ual_daemon.flight.policy.lease import EXPIRES_AFTER_S
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.server.access import caller
from ual_daemon.server.services.uav import UalServicerBase
from ual_daemon.server.telemetry_stream import Updates
from ual_daemon.server.transport.base import ServedCall
from ual_daemon.server.waiting import after, completion, ended
from ual_daemon.vehicle.planning import PlanFigures, Planning
from ual_daemon.vehicle.prepared import Prepared

if TYPE_CHECKING:
    from ual_daemon.choice import ServedVehicle

R = TypeVar("R")
_Maybe: TypeAlias = R | Awaitable[R]
"""A response, or a coroutine that returns it."""

_log = logging.getLogger(__name__)

_LONGEST_HOLDER_CHARACTERS = 64


class UalServicer(UalServicerBase):
    """The interface of one vehicle. ``ual/v1/ual.proto`` describes each method, `dispatch` how it is answered."""

    def __init__(self, vehicle: ServedVehicle, updates: Updates) -> None:
        self._vehicle = vehicle
        self._updates = updates
        self._planning = Planning()
        self._routing = Planning()  # so that reading a route takes no place from planning a flight

    @property
    def plans(self) -> PlanFigures:
        """Counts and durations of planned paths."""
        return self._planning.figures

    # Names and order are those of the contract.

    @override
    def StreamTelemetry(  # type: ignore[override] # sent where the updates come from: see `dispatch`
        self, request: pb.StreamTelemetryRequest, context: ServedCall
    ) -> Callable[[], None]:
        return self._updates.read(_rate_hz(request.rate_hz), context.send)

    @override
    async def GetRoute(self, request: pb.GetRouteRequest, context: object) -> pb.GetRouteResponse:
        # The outline of a path with thousands of waypoints takes a while: nothing that flies or serves waits for it.
        route = await ended(self._routing.begin("route", self._vehicle.route))
        return pb.GetRouteResponse(route=None if route is None else uav.route_to_proto(route))

    @override
    def AddFrame(self, request: pb.AddFrameRequest, context: object) -> pb.AddFrameResponse:
        self._vehicle.frame_editor.add(motions.new_frame_from_proto(request))
        return pb.AddFrameResponse()

    @override
    def RemoveFrame(self, request: pb.RemoveFrameRequest, context: object) -> pb.RemoveFrameResponse:
        self._vehicle.frame_editor.remove(request.frame_id)
        return pb.RemoveFrameResponse()

    @override
    def TakeOff(self, request: pb.TakeOffRequest, context: object) -> _Maybe[pb.TakeOffResponse]:
        return self._task(request, lease_of(context), pb.TakeOffResponse)

    @override
    def Land(self, request: pb.LandRequest, context: object) -> _Maybe[pb.LandResponse]:
        return self._task(request, lease_of(context), pb.LandResponse)

    @override
    def GoToWaypoint(self, request: pb.GoToWaypointRequest, context: object) -> _Maybe[pb.GoToWaypointResponse]:
        return self._task(request, lease_of(context), pb.GoToWaypointResponse)

    @override
    def GoToWaypointGeo(
        self, request: pb.GoToWaypointGeoRequest, context: object
    ) -> _Maybe[pb.GoToWaypointGeoResponse]:
        return self._task(request, lease_of(context), pb.GoToWaypointGeoResponse)

    @override
    def FollowPath(self, request: pb.FollowPathRequest, context: object) -> Awaitable[pb.FollowPathResponse]:
        # Planning takes a while where there are thousands of waypoints: what stops the UAV must get through meanwhile.
        lease_id = lease_of(context)
        prepare = partial(self._prepare, request, lease_id, self._vehicle.commands.last_command)
        return self._follow_path(request, lease_id, self._planning.begin("follow_path", prepare))

    @override
    def ReturnToLaunch(self, request: pb.ReturnToLaunchRequest, context: object) -> _Maybe[pb.ReturnToLaunchResponse]:
        return self._task(request, lease_of(context), pb.ReturnToLaunchResponse)

    async def _follow_path(
        self, request: pb.FollowPathRequest, lease_id: str, planned: Future[Prepared[VehicleTask]]
    ) -> pb.FollowPathResponse:
        response = self._begun(await ended(planned), request, lease_id, pb.FollowPathResponse)
        return await response if isinstance(response, Awaitable) else response

    def _prepare(self, request: motions.TaskRequestMessage, lease_id: str, since: LastCommand) -> Prepared[VehicleTask]:
        return self._vehicle.commands.prepare(motions.task_request_from_proto(request), lease_id, since)

    def _task(self, request: motions.TaskRequestMessage, lease_id: str, make: Callable[..., R]) -> _Maybe[R]:
        prepared = self._vehicle.commands.prepare(motions.task_request_from_proto(request), lease_id)
        return self._begun(prepared, request, lease_id, make)

    def _begun(
        self,
        prepared: Prepared[VehicleTask],
        request: motions.TaskRequestMessage,
        lease_id: str,
        make: Callable[..., R],
    ) -> _Maybe[R]:
        """The response with the plan of a dry run, or with the task that begins now."""
        if request.dry_run:
            return make(plan=uav.plan_to_proto(prepared.plan))
        return self._outcome(prepared.begin(), lease_id, make, request.non_blocking)

    async def _outcome(self, task: VehicleTask, lease_id: str, make: Callable[..., R], non_blocking: bool) -> R:
        """The response with a task that has begun: at once, or when it has ended. Its error where it did not succeed.

        A go-to or path is cancelled when its caller stops waiting: its deadline passed, or it vanished.
        """
        if not non_blocking:
            try:
                await ended(task.future)
            except asyncio.CancelledError:
                is_cancelled = self._vehicle.commands.abandon(task, lease_id)
                logs.event(
                    _log, logging.WARNING, "caller_gone", task=task.id, kind=task.kind.name, cancelled=is_cancelled
                )
                raise
        return make(task=uav.task_info_to_proto(task.info()))

    @override
    def SetPose(self, request: pb.SetPoseRequest, context: object) -> pb.SetPoseResponse:
        pose, lease_id = motions.pose_setpoint_from_proto(request), lease_of(context)
        if request.dry_run:
            return pb.SetPoseResponse(plan=uav.plan_to_proto(self._vehicle.commands.plan(pose, lease_id)))
        self._vehicle.commands.setpoints.set_pose(pose, lease_id)
        return pb.SetPoseResponse()

    @override
    def SetVelocity(self, request: pb.SetVelocityRequest, context: object) -> pb.SetVelocityResponse:
        velocity, lease_id = motions.velocity_setpoint_from_proto(request), lease_of(context)
        if request.dry_run:
            return pb.SetVelocityResponse(plan=uav.plan_to_proto(self._vehicle.commands.plan(velocity, lease_id)))
        self._vehicle.commands.setpoints.set_velocity(velocity, lease_id)
        return pb.SetVelocityResponse()

    @override
    def StreamSetpoints(  # type: ignore[override] # each is taken where it was received: see `dispatch`
        self, request_iterator: None, context: object
    ) -> Generator[None, pb.StreamSetpointsRequest | None, pb.StreamSetpointsResponse]:
        accepted_count = 0
        setpoints, lease_id = self._vehicle.commands.setpoints, lease_of(context)
        while (request := (yield)) is not None:
            setpoint = motions.setpoint_from_proto(request)
            if isinstance(setpoint, TwistStamped):
                setpoints.set_velocity(setpoint, lease_id)
            else:
                setpoints.set_pose(setpoint, lease_id)
            accepted_count += 1
        return pb.StreamSetpointsResponse(accepted_count=accepted_count)

    @override
    def SetExternalPose(self, request: pb.SetExternalPoseRequest, context: object) -> pb.SetExternalPoseResponse:
        dropped = self._vehicle.external_poses.set(motions.external_pose_from_proto(request))
        return pb.SetExternalPoseResponse(dropped=dropped)

    @override
    def StreamExternalPoses(  # type: ignore[override] # each is taken where it was received: see `dispatch`
        self, request_iterator: None, context: object
    ) -> Generator[None, pb.StreamExternalPosesRequest | None, pb.StreamExternalPosesResponse]:
        accepted_count = dropped_count = 0
        while (request := (yield)) is not None:
            if self._vehicle.external_poses.offer(motions.external_pose_from_proto(request)):
                dropped_count += 1
            else:
                accepted_count += 1
        return pb.StreamExternalPosesResponse(accepted_count=accepted_count, dropped_count=dropped_count)

    @override
    def RecoverFromManual(
        self, request: pb.RecoverFromManualRequest, context: object
    ) -> _Maybe[pb.RecoverFromManualResponse]:
        prepared = self._vehicle.commands.recover_from_manual(lease_of(context), force=request.force)
        if request.dry_run:
            return pb.RecoverFromManualResponse(plan=uav.plan_to_proto(prepared.plan))
        return after(prepared.begin(), pb.RecoverFromManualResponse())

    @override
    def AcquireLease(self, request: pb.AcquireLeaseRequest, context: object) -> pb.AcquireLeaseResponse:
        who = caller.current.get()
        if request.take:
            who.require(Role.COMMANDER, "taking the lease")
        holder = request.holder or logs.caller_text()[:_LONGEST_HOLDER_CHARACTERS] or who.name
        lease_id = self._vehicle.acquire_lease(holder, who.name, take=request.take, lease_id=lease_of(context))
        return pb.AcquireLeaseResponse(
            lease_id=lease_id,
            lease=self._lease(),
            expires_after_s=EXPIRES_AFTER_S,
        )

    @override
    def KeepLease(self, request: pb.KeepLeaseRequest, context: object) -> pb.KeepLeaseResponse:
        self._vehicle.keep_lease(request.lease_id)
        return pb.KeepLeaseResponse()

    @override
    def ReleaseLease(self, request: pb.ReleaseLeaseRequest, context: object) -> pb.ReleaseLeaseResponse:
        self._vehicle.release_lease(request.lease_id)
        return pb.ReleaseLeaseResponse()

    @override
    def GetLease(self, request: pb.GetLeaseRequest, context: object) -> pb.GetLeaseResponse:
        return pb.GetLeaseResponse(lease=self._lease())

    def _lease(self) -> pb.Lease | None:
        lease = self._vehicle.lease()
        return None if lease is None else uav.lease_info_to_proto(lease)

    @override
    def GetTask(self, request: pb.GetTaskRequest, context: object) -> pb.GetTaskResponse:
        return pb.GetTaskResponse(task=uav.task_info_to_proto(self._vehicle.task(request.task_id).info()))

    @override
    async def WatchTask(self, request: pb.WatchTaskRequest, context: object) -> AsyncIterator[pb.WatchTaskResponse]:
        period_s = validation.watch_period_s(request.rate_hz)
        task = self._vehicle.task(request.task_id)
        done = completion(task.future)
        while not done.done():
            yield pb.WatchTaskResponse(task=uav.task_info_to_proto(task.info()))
            await asyncio.wait((done,), timeout=period_s)
        yield pb.WatchTaskResponse(task=uav.task_info_to_proto(task.info()))


def _rate_hz(rate_hz: float) -> float:
    return validation.not_negative(rate_hz, "rate_hz", at_most=validation.MAX_STREAM_RATE_HZ)
