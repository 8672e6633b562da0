"""A `ual.interface.Uav` that knows its UAV by ROS only: by services, actions and topics of the node, and by tf.

What ROS has nothing for raises `InexpressibleError`. Three things are not ROS' part and are given: what the program
knows of its UAV before (`Info`), the simulated world, in which the safety pilot is, and the time of that world.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NoReturn

from flying import CANCELED, LIMIT_S, Client, waited
from geometry_msgs.msg import PointStamped, PoseStamped, PoseWithCovarianceStamped, TwistStamped
from inexpressible import InexpressibleError
from nav_msgs.msg import Path
from sensor_msgs.msg import NavSatFix
from std_srvs.srv import Trigger
from telling import Told
from typing_extensions import Self
from ual_msgs import action, srv

import ual
from ual.geometry import stamped_pose, stamped_twist
from ual.interface import DryRun, Lease, Simulation, Task, Uav
from ual.parameters.values import Parameter, ParameterType
from ual.types import (
    FollowPathRequest,
    GoToWaypointGeoRequest,
    GoToWaypointRequest,
    LandRequest,
    ReturnToLaunchRequest,
    TakeOffRequest,
    TaskRequest,
)
from ual_ros2 import values

NAMES: Mapping[type, str] = {
    TakeOffRequest: "take_off",
    LandRequest: "land",
    GoToWaypointRequest: "go_to_waypoint",
    GoToWaypointGeoRequest: "go_to_waypoint_geo",
    FollowPathRequest: "follow_path",
    ReturnToLaunchRequest: "return_to_launch",
}

PUBLISHED = {"set_pose": PoseStamped, "set_velocity": TwistStamped, "external_pose_cov": PoseWithCovarianceStamped}
TIMES, BETWEEN_S = 3, 0.03
"""A topic may lose a message: so a pose is published more than once, and a velocity again and again anyway."""


def inexpressible(member: str) -> NoReturn:
    """Says that ROS has nothing for a member."""
    raise InexpressibleError(member)


class RosUav(Uav):
    """One UAV of a node."""

    def __init__(self, client: Client, info: ual.Info, world: Simulation, now_s: Callable[[], float]) -> None:
        self._client = client
        self._info = info
        self._world = world
        self._now_s = now_s
        self._told = Told(client, info.namespace)
        for name, kind in PUBLISHED.items():
            client.publisher(kind, f"/{info.namespace}/ual/{name}", 10)  # the first message on a new one may be lost
        waited(lambda: self.telemetry().transform is not None)

    # --- What is known ------------------------------------------------------------------------------------------------

    @property
    def ns(self) -> str:
        return self._info.namespace

    def close(self) -> None:
        """Does nothing: the client in ROS ends all."""

    def info(self) -> ual.Info:
        return self._info

    def telemetry(self) -> ual.Telemetry:
        return self._told.sample(self._now_s())

    def subscribe(self, callback: Callable[[ual.Telemetry], None], rate_hz: float = 0.0) -> Subscribed:
        if rate_hz:
            inexpressible("rate_hz")
        return Subscribed(self._told, callback)

    def transform(self, target_frame_id: str = "", source_frame_id: str = "") -> ual.Transform:
        return self._told.transform(target_frame_id or "map", source_frame_id or f"{self.ns}/base_link")

    def frames(self) -> list[ual.Frame]:
        return self._told.frames()

    @property
    def simulation(self) -> Simulation:
        return self._world

    # --- Commands -----------------------------------------------------------------------------------------------------

    def _begin(self, request: TaskRequest, blocking: bool, timeout_s: float | None) -> Task:
        """Begins by the service where that waits and has all fields, else by the action, so that both are flown."""
        name = NAMES[type(request)]
        service = _service(request)
        if blocking and timeout_s is None and service is not None:
            kind, fields = service
            self._call(kind, name, **fields, blocking=True)
            return Done(ual.TaskKind[name.upper()])
        kind, fields = _goal(request)
        manoeuvre = Manoeuvre(self, self._client, kind, name, fields)
        if timeout_s is not None:
            manoeuvre.wait_or_cancel(timeout_s)
        elif blocking:
            manoeuvre.wait()
        else:
            manoeuvre.wait_until_begun()
        return manoeuvre

    def set_home(self, set_z: bool = False) -> None:
        self._call(srv.SetHome, "set_home", set_z=set_z)

    def abort(self, freeze: bool = False) -> None:
        self._call(srv.Abort, "abort", freeze=freeze)

    def arm(self, *, timeout_s: float | None = None) -> None:
        self._trigger("arm", timeout_s)

    def disarm(self, *, timeout_s: float | None = None) -> None:
        self._trigger("disarm", timeout_s)

    def recover_from_manual(self, *, force: bool = False, timeout_s: float | None = None) -> None:
        if force:
            inexpressible("force")
        self._trigger("recover", timeout_s)

    def pause(self) -> None:
        self._trigger("pause")

    def resume(self) -> None:
        self._trigger("resume")

    def set_pose(self, pose: ual.PoseStamped | ual.Pose) -> None:
        message = _pose(stamped_pose(pose))
        for _ in range(TIMES):
            self._publish(PoseStamped, "set_pose", message)
            time.sleep(BETWEEN_S)

    def set_velocity(self, velocity: ual.TwistStamped | ual.Twist) -> None:
        stamped, message = stamped_twist(velocity), TwistStamped()
        message.header.frame_id = stamped.frame_id
        values.fill_twist(message.twist, stamped.twist)
        self._publish(TwistStamped, "set_velocity", message)

    def set_external_pose(
        self,
        pose: ual.PoseStamped | ual.Pose,
        *,
        position_std_dev_m: float | None = None,
        orientation_std_dev_rad: float | None = None,
    ) -> None:
        stamped = stamped_pose(pose)
        message = PoseWithCovarianceStamped()
        message.header.frame_id = stamped.frame_id
        message.header.stamp.sec, message.header.stamp.nanosec = values.split(stamped.stamp_s)
        values.fill_pose(message.pose.pose, stamped.pose)
        deviations = [position_std_dev_m or 0.0] * 3 + [orientation_std_dev_rad or 0.0] * 3
        message.pose.covariance[::7] = [each**2 for each in deviations]
        self._publish(PoseWithCovarianceStamped, "external_pose_cov", message)

    @property
    def parameters(self) -> RosParameters:
        return RosParameters(self._call)

    def _call(self, kind: Any, name: str, /, **fields: Any) -> Any:
        answer = self._client.call(kind, f"/{self.ns}/ual/{name}", **fields)
        if not answer.success:
            raise error_of(answer)
        return answer

    def _trigger(self, name: str, timeout_s: float | None = None) -> None:
        if timeout_s is not None:
            inexpressible("timeout_s")
        answer = self._client.call(Trigger, f"/{self.ns}/ual/{name}")
        if not answer.success:
            text, _, metadata = answer.message.partition("\n")
            reason, _, message = text.partition(": ")
            raise ual.errors.from_reason(reason, message, json.loads(metadata or "{}"))

    def _publish(self, kind: Any, name: str, message: Any) -> None:
        self._client.publish(kind, f"/{self.ns}/ual/{name}", message, 10)

    # --- What ROS has nothing for -------------------------------------------------------------------------------------

    def geofence(self) -> ual.types.Geofence:
        inexpressible("geofence")

    def route(self) -> ual.types.Route | None:
        inexpressible("route")

    def add_frame(self, transform: ual.Transform) -> None:
        inexpressible("add_frame")

    def remove_frame(self, frame_id: str) -> None:
        inexpressible("remove_frame")

    def lease(self, holder: str = "", *, take: bool = False) -> Lease:
        inexpressible("lease")

    def lease_info(self) -> ual.types.LeaseInfo | None:
        inexpressible("lease_info")

    def extension(self, name: str) -> Any:
        inexpressible("extension")

    def task(self, task_id: str) -> Task:
        inexpressible("task")

    @property
    def cameras(self) -> ual.interface.Cameras:
        inexpressible("cameras")

    @property
    def gimbals(self) -> ual.interface.Gimbals:
        inexpressible("gimbals")

    @property
    def mission(self) -> ual.interface.Mission:
        inexpressible("mission")

    @property
    def gripper(self) -> ual.interface.Gripper:
        inexpressible("gripper")

    @property
    def fence(self) -> ual.interface.Fence:
        inexpressible("fence")

    @property
    def logs(self) -> ual.interface.Logs:
        inexpressible("logs")

    @property
    def corrections(self) -> ual.interface.Corrections:
        inexpressible("corrections")

    @property
    def dry_run(self) -> DryRun[ual.types.Plan]:
        inexpressible("dry_run")


class RosParameters:
    """The autopilot's parameters, by the services of the node."""

    def __init__(self, call: Callable[..., Any]) -> None:
        self._call = call

    def get(self, name: str) -> Parameter:
        return _parameter(self._call(srv.GetParameter, "get_parameter", name=name).parameter)

    def get_all(self) -> list[Parameter]:
        return [_parameter(each) for each in self._call(srv.ListParameters, "list_parameters").parameters]

    def set(self, name: str, value: float, *, force: bool = False) -> Parameter:
        answer = self._call(srv.SetParameter, "set_parameter", name=name, value=float(value), force=force)
        return _parameter(answer.parameter)


def _parameter(message: Any) -> Parameter:
    kind = ParameterType[message.type]
    return Parameter(
        message.name,
        int(message.value) if kind.is_whole else message.value,
        kind,
        message.is_relied_on,
        None if math.isnan(message.minimum) else message.minimum,
        None if math.isnan(message.maximum) else message.maximum,
        message.unit,
        message.description,
        message.needs_reboot,
    )


class Subscribed:
    """A subscription to the samples."""

    def __init__(self, told: Told, callback: Callable[[ual.Telemetry], None]) -> None:
        self._told = told
        self._callback = callback
        told.begin(callback)

    def close(self) -> None:
        """Ends it."""
        self._told.end(self._callback)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()


class Done(Task):
    """A task whose service has answered that it is done. ROS gives it no name."""

    id = ""

    def __init__(self, kind: ual.TaskKind) -> None:
        self._kind = kind

    @property
    def kind(self) -> ual.TaskKind:
        return self._kind

    def info(self) -> ual.TaskInfo:
        return ual.TaskInfo("", self._kind, ual.TaskStatus.SUCCEEDED)

    def done(self) -> bool:
        return True

    def wait(self, timeout_s: float | None = None) -> ual.TaskInfo:
        return self.info()

    def cancel(self) -> None:
        """Does nothing: it has ended."""

    def pause(self) -> None:
        raise ual.WrongStateError("it has ended")

    def resume(self) -> None:
        raise ual.WrongStateError("it has ended")

    def watch(self, rate_hz: float = 10.0) -> Iterator[ual.TaskInfo]:
        yield self.info()


class Manoeuvre(Task):
    """A goal of an action."""

    def __init__(self, uav: RosUav, client: Client, kind: Any, name: str, fields: Mapping[str, Any]) -> None:
        self._uav = uav
        self._client = client
        self._kind = ual.TaskKind[name.upper()]
        self._feedback: list[Any] = []
        self._goal = client.begin(kind, f"/{uav.ns}/ual/{name}", self._feedback.append, **fields)
        self._end = client.end_soon(self._goal)

    @property
    def id(self) -> str:
        return bytes(self._goal.goal_id.uuid).hex()

    @property
    def kind(self) -> ual.TaskKind:
        return self._kind

    def info(self) -> ual.TaskInfo:
        if not self.done():
            now = self._uav.telemetry().task
            is_paused = now is not None and now.is_paused
            return ual.TaskInfo(self.id, self._kind, ual.TaskStatus.RUNNING, is_paused=is_paused)
        result = self._end.result().result
        failed = ual.TaskStatus.ABORTED if result.reason == "TASK_ABORTED" else ual.TaskStatus.FAILED
        return ual.TaskInfo(self.id, self._kind, ual.TaskStatus.SUCCEEDED if result.success else failed)

    def done(self) -> bool:
        return bool(self._end.done())

    def wait(self, timeout_s: float | None = None) -> ual.TaskInfo:
        limit_s = LIMIT_S if timeout_s is None else timeout_s
        if not self._ends_within(limit_s):
            raise ual.UalTimeoutError(f"it has not ended within {limit_s:g} s")
        result = self._end.result().result
        if not result.success:
            raise error_of(result)
        return self.info()

    def wait_until_begun(self) -> None:
        """Returns once it flies, which the feedback tells, or has ended.

        Raises:
            UalError: It was refused.

        """
        waited(lambda: self._feedback or self.done())
        if self.done() and not self._feedback:
            self.wait()

    def wait_or_cancel(self, timeout_s: float) -> None:
        """Waits for the end; cancels it when the time has passed, as a program in ROS does.

        Raises:
            UalTimeoutError: It has not ended in time.
            UalError: The error that it ended with.

        """
        if not self._ends_within(timeout_s):
            self.cancel()
            waited(self.done)
            if self._end.result().status == CANCELED:
                raise ual.UalTimeoutError(f"it has not ended within {timeout_s:g} s")
        self.wait()

    def _ends_within(self, time_s: float) -> bool:
        deadline_s = time.monotonic() + time_s
        while not self.done() and time.monotonic() < deadline_s:
            time.sleep(0.005)
        return self.done()

    def cancel(self) -> None:
        if not self.done() and not self._client.cancel(self._goal) and not self.done():
            raise ual.WrongStateError("the node rejects that the goal is cancelled")

    def pause(self) -> None:
        self._uav.pause()

    def resume(self) -> None:
        self._uav.resume()

    def watch(self, rate_hz: float = 10.0) -> Iterator[ual.TaskInfo]:
        inexpressible("watch")


def error_of(answer: Any) -> ual.UalError:
    """The error of an answer or result that tells a refusal."""
    return ual.errors.from_reason(answer.reason, answer.message, {each.key: each.value for each in answer.metadata})


Call = tuple[Any, dict[str, Any]]
"""A type of messages, and the fields of its request or goal."""


def _service(request: TaskRequest) -> Call | None:
    """The call of the service that can say all of a request; None where only the action can."""
    match request:
        case TakeOffRequest(height_m, force=False):
            return srv.TakeOff, {"height": height_m}
        case LandRequest():
            return srv.Land, {}
        case GoToWaypointRequest(waypoint, None):
            return srv.GoToWaypoint, {"waypoint": _pose(waypoint)}
        case GoToWaypointGeoRequest(place, None) if place.yaw_rad is None:
            return srv.GoToWaypointGeo, _geo(place)
        case ReturnToLaunchRequest(height_m):
            return srv.ReturnToLaunch, {"height": height_m or 0.0}
    return None


def _goal(request: TaskRequest) -> Call:
    """The goal of the action."""
    match request:
        case TakeOffRequest(height_m, force):
            return action.TakeOff, {"height": height_m, "force": force}
        case LandRequest():
            return action.Land, {}
        case GoToWaypointRequest(waypoint, max_speed_m_s):
            return action.GoToWaypoint, {"waypoint": _pose(waypoint), "max_speed": max_speed_m_s or 0.0}
        case GoToWaypointGeoRequest(place, max_speed_m_s):
            yaw = {} if place.yaw_rad is None else {"has_yaw": True, "yaw": place.yaw_rad}
            return action.GoToWaypointGeo, {**_geo(place), **yaw, "max_speed": max_speed_m_s or 0.0}
        case FollowPathRequest():
            return action.FollowPath, _path(request)
        case ReturnToLaunchRequest(return_height_m):
            return action.ReturnToLaunch, {"height": return_height_m or 0.0}


def _pose(stamped: ual.PoseStamped) -> Any:
    message = PoseStamped()
    message.header.frame_id = stamped.frame_id
    values.fill_pose(message.pose, stamped.pose)
    return message


def _geo(place: ual.GeoWaypoint) -> dict[str, Any]:
    fix = NavSatFix(latitude=place.latitude_deg, longitude=place.longitude_deg, altitude=place.altitude_m)
    return {"waypoint": fix, "altitude_reference": place.altitude_reference.value}


def _path(request: FollowPathRequest) -> dict[str, Any]:
    fields: dict[str, Any] = {
        "path": Path(poses=[_pose(each) for each in _poses(request.waypoints)]),
        "corner_radius": request.corner_radius_m,
        "max_speed": request.max_speed_m_s or 0.0,
        "leg_speeds": list(request.leg_speeds_m_s),
        "heading": request.heading.value,
        "holds": list(request.holds_s),
    }
    interest = request.point_of_interest
    if interest is not None:
        message = fields["point_of_interest"] = PointStamped()
        message.header.frame_id = interest.frame_id
        values.fill_vector(message.point, interest.point)
    return fields


def _poses(waypoints: Sequence[ual.PoseStamped | ual.GeoWaypoint]) -> Iterator[ual.PoseStamped]:
    for each in waypoints:
        if isinstance(each, ual.GeoWaypoint):
            inexpressible("a path of geographic waypoints")
        yield each
