"""Calls: the way they are made, and those of the UAV that are more than a request and its response.

The client and its asyncio twin differ only in how they make a call, never in what is in it. Each other call is in
`ual._service_calls`, as it follows from the contract.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

from google.protobuf.message import Message

from ual._wrong_type import require_parts, wrong_part
from ual.contract.method import QUICK_S
from ual.contract.methods import METHODS
from ual.errors import ClientUnusableError, InvalidArgumentError, NotSupportedError, UalError, UalTimeoutError
from ual.geometry import (
    Pose,
    PoseStamped,
    Twist,
    TwistStamped,
    stamped_pose,
    stamped_twist,
)
from ual.shared.flags import flag
from ual.shared.time_limit import time_limit
from ual.shared.tracing import Metadata, of_environment
from ual.types import (
    ExternalPose,
    FollowPathRequest,
    GoToWaypointGeoRequest,
    GoToWaypointRequest,
    LandRequest,
    MotionRequest,
    Plan,
    RecoverFromManualRequest,
    ReturnToLaunchRequest,
    Setpoint,
    TakeOffRequest,
    TaskInfo,
    TaskRequest,
    TaskStatus,
)
from ual.v1 import ual_pb2 as pb
from ual.wire import motions, uav

T = TypeVar("T")

_UNTRACED: AbstractContextManager[Metadata] = nullcontext(())
# How long a call waits for a daemon that was there before: longer than gRPC's pause between two tries to connect.
RECONNECT_S = 1.0

# No answer came: so whether it reached the UAV is not known.
_GOES_ON = "if it reached the UAV it goes on: ask for the state"


@dataclass(frozen=True, slots=True)
class Call(Generic[T]):
    """One call of the method `method` of a service.

    `quick_s` is the time limit where the caller gave none; None for calls that wait for the vehicle. `at_timeout` says
    what becomes of what was requested when the time is over.
    """

    service: str
    method: str
    request: Message
    read: Callable[[Any], T]
    quick_s: float | None = QUICK_S
    at_timeout: str = ""
    is_stream: bool = False
    """Whether the responses are a stream, of which `read` takes all."""


def traced(call: Call[Any]) -> AbstractContextManager[Metadata]:
    """Traces a call, where the environment requests it; see `ual.shared.tracing`. Returns the metadata for that."""
    tracing = of_environment()
    return _UNTRACED if tracing is None else tracing.calling(f"ual.v1.{call.service}", call.method)


def deadline(call: Call[Any], timeout_s: float | None) -> float | None:
    """The time limit of a call, as the caller says, or its own."""
    limit_s = time_limit(timeout_s)
    return call.quick_s if limit_s is None else limit_s


def in_time(error: UalError, call: Call[Any], limit_s: float | None) -> UalError:
    """The error; where the caller's time was over, one that says what that means."""
    if isinstance(error, UalTimeoutError) and "grpc_code" in error.metadata and limit_s is not None:
        what_then = f"; {call.at_timeout}" if call.at_timeout else ""
        return UalTimeoutError(f"{call.method} did not end within {limit_s:g} s{what_then}", error.metadata)
    return error


def rate(rate_hz: float) -> float:
    """Returns the wanted rate of samples as a number; the daemon decides which numbers are allowed."""
    try:
        if not isinstance(rate_hz, (str, bytes, bytearray)):  # float() would read them
            return float(rate_hz)
    except OverflowError:  # an integer
        return math.inf
    except (TypeError, ValueError):
        pass
    raise InvalidArgumentError(f"rate_hz: {repr(rate_hz)[:100]} is not a number", {"field": "rate_hz"})


def closed() -> UalError:
    """Returns the error that calls of a closed client raise."""
    return ClientUnusableError("this client is closed")


def of(method: str, request: Message, read: Callable[[Any], T], is_stream: bool = False) -> Call[T]:
    """The call of a method, with the time limit that the contract says."""
    facts = METHODS[method]
    return Call(facts.service, method, request, read, facts.caller_limit_s, facts.at_timeout, is_stream)


def nothing(_: object) -> None:
    """Reads a response that says no more than that it is one."""
    return


def request(kind: Callable[..., Any], /, **fields: object) -> Any:  # noqa: ANN401 (the request of a method)
    """Makes a request. Raises `InvalidArgumentError` that names a field whose value protobuf refuses."""
    try:
        return kind(**fields)
    except _UNFIT as error:
        at_fault = next((name for name, value in fields.items() if not _takes(kind, name, value)), next(iter(fields)))
        raise InvalidArgumentError(f"{at_fault}: {error}", {"field": at_fault}) from None


def _takes(kind: Callable[..., Any], field: str, value: object) -> bool:
    try:
        kind(**{field: value})
    except _UNFIT:
        return False
    return True


_UNFIT = (TypeError, ValueError, AttributeError, OverflowError)
"""By these a request refuses what is no number, no text, or too large."""


def built(make: Callable[[], Message], field: str, value: object = None) -> Message:
    """Makes a request. `value` is searched for what protobuf refuses, and the error names that."""
    try:
        request = make()
    except InvalidArgumentError:
        raise
    except _UNFIT as error:
        raise wrong_part(value, field, error) from None
    require_parts(value, field)
    return request


def recover_from_manual(force: bool = False) -> Call[None]:
    request = pb.RecoverFromManualRequest(force=flag(force, "force"))
    return of("RecoverFromManual", request, nothing)


def abort(freeze: bool = False, task_id: str = "") -> Call[None]:
    return of("Abort", pb.AbortRequest(freeze=flag(freeze, "freeze"), task_id=task_id), nothing)


def pause(task_id: str = "") -> Call[None]:
    return of("Pause", pb.PauseRequest(task_id=task_id), nothing)


def resume(task_id: str = "") -> Call[None]:
    return of("Resume", pb.ResumeRequest(task_id=task_id), nothing)


def acquire_lease(holder: str, take: bool) -> Call[str]:
    is_taken = flag(take, "take")

    def read(response: pb.AcquireLeaseResponse) -> str:
        return response.lease_id

    request = built(lambda: pb.AcquireLeaseRequest(holder=holder, take=is_taken), "holder", holder)
    return of("AcquireLease", request, read)


def keep_lease(lease_id: str) -> Call[None]:
    return of("KeepLease", pb.KeepLeaseRequest(lease_id=lease_id), nothing)


def release_lease(lease_id: str) -> Call[None]:
    return of("ReleaseLease", pb.ReleaseLeaseRequest(lease_id=lease_id), nothing)


def get_task(task_id: str) -> Call[TaskInfo]:
    if not isinstance(task_id, str):
        raise InvalidArgumentError(f"task_id: there is no task {task_id!r:.100}", {"field": "task_id"})
    request = built(lambda: pb.GetTaskRequest(task_id=task_id), "task_id")
    return of("GetTask", request, _read_task)


# Tasks: as non-blocking they are answered at once

_TASK_METHODS: Mapping[type[TaskRequest], tuple[str, str]] = {
    TakeOffRequest: ("TakeOff", "height_m"),
    LandRequest: ("Land", "land"),
    GoToWaypointRequest: ("GoToWaypoint", "waypoint"),
    GoToWaypointGeoRequest: ("GoToWaypointGeo", "waypoint"),
    FollowPathRequest: ("FollowPath", "waypoints"),
    ReturnToLaunchRequest: ("ReturnToLaunch", "height_m"),
}
"""The method of each request, and the field named where protobuf refuses a value."""


def begin_task(request: TaskRequest, blocking: bool = True) -> Call[TaskInfo]:
    """The call that begins a task, and waits for its end where it is blocking."""
    method, field = _TASK_METHODS[type(request)]
    is_waited_for = flag(blocking, "blocking")
    message = built(lambda: motions.task_request_to_proto(request, non_blocking=not is_waited_for), field, request)
    call = of(method, message, _read_task)
    return call if is_waited_for else replace(call, quick_s=QUICK_S, at_timeout=_GOES_ON)


def _read_task(response: Any) -> TaskInfo:  # noqa: ANN401 (each task's response has a type of its own)
    return uav.task_info_from_proto(response.task)


def has_ended(task: TaskInfo) -> bool:
    """True once a task has ended, however."""
    return task.status is not TaskStatus.RUNNING


# Dry runs


def dry_run(motion: MotionRequest) -> Call[Plan]:
    """A motion as a question: nothing moves."""
    if isinstance(motion, RecoverFromManualRequest):
        call: Call[Any] = recover_from_manual(motion.force)
    elif isinstance(motion, (PoseStamped, TwistStamped)):
        call = single_setpoint(setpoint(motion, "pose" if isinstance(motion, PoseStamped) else "velocity"))
    elif type(motion) in _TASK_METHODS:
        call = begin_task(motion)
    else:
        raise InvalidArgumentError(f"{motion!r:.100} is no motion")
    request: Any = call.request
    request.dry_run = True
    return Call(call.service, call.method, request, _read_plan)


def _read_plan(response: Any) -> Plan:  # noqa: ANN401 (each motion's response has a type of its own)
    if not response.HasField("plan"):
        raise NotSupportedError(
            "the daemon is too old for dry runs, and has taken this for the command itself; abort stops the UAV"
        )
    return uav.plan_from_proto(response.plan)


# Setpoints


def set_pose(pose: PoseStamped | Pose) -> pb.StreamSetpointsRequest:
    return setpoint(stamped_pose(pose), "pose")


def set_velocity(velocity: TwistStamped | Twist) -> pb.StreamSetpointsRequest:
    return setpoint(stamped_twist(velocity), "velocity")


def setpoint(reference: Setpoint, field: str) -> pb.StreamSetpointsRequest:
    """A reference as an element of the stream. `field` is named where protobuf refuses a value."""
    try:
        if isinstance(reference.frame_id, bytes):  # protobuf would take them; the only part that each setpoint checks
            raise TypeError("bytes")
        return motions.setpoint_to_proto(reference)
    except _UNFIT as error:
        raise wrong_part(reference, field, error) from None


def single_setpoint(element: pb.StreamSetpointsRequest) -> Call[None]:
    """One element of the stream as a call that is answered."""
    if element.HasField("velocity"):
        return of("SetVelocity", pb.SetVelocityRequest(velocity=element.velocity), nothing)
    return of("SetPose", pb.SetPoseRequest(pose=element.pose), nothing)


# Poses from outside


def set_external_pose(
    pose: PoseStamped | Pose, position_std_dev_m: float | None, orientation_std_dev_rad: float | None
) -> pb.StreamExternalPosesRequest:
    measured = ExternalPose(stamped_pose(pose), position_std_dev_m, orientation_std_dev_rad)
    try:
        if isinstance(measured.pose.frame_id, bytes):
            raise TypeError("bytes")
        return motions.external_pose_to_proto(measured)
    except _UNFIT as error:
        raise wrong_part(measured, "external_pose", error) from None


def single_external_pose(element: pb.StreamExternalPosesRequest) -> Call[None]:
    """One element of the stream as a call that is answered."""
    request = pb.SetExternalPoseRequest(external_pose=element.external_pose)
    return of("SetExternalPose", request, nothing)
