"""A `ual.interface.Uav` that knows its UAV by ROS only: by services, actions and topics of the node, and by tf.

What ROS has nothing for raises `InexpressibleError`. One thing is not ROS' part and is given: the time of the simulated
world. `ros_services` has the other services.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import fields as fields_of
from typing import Any, NoReturn

from derived_members import ServiceMembers
from derived_values import (
    ask_add_frame,
    ask_follow_path,
    ask_go_to_waypoint,
    ask_go_to_waypoint_geo,
    ask_land,
    ask_return_to_launch,
    ask_take_off,
    read_frame,
    read_plan,
)
from flying import Client, waited
from inexpressible import InexpressibleError
from reading import error_of
from ros_requests import LatchedTopics
from ros_services import Asking, ServicesOverRos
from ros_setpoints import Setpoints
from ros_tasks import ActionGoal, RosTask, info_of
from std_srvs.srv import Trigger
from telling import ReportedSample
from typing_extensions import Self
from ual_msgs import action, srv

import ual
from ual.geometry import stamped_pose, stamped_twist
from ual.interface import DryRun, Lease, Simulation, Task
from ual.shared.time_limit import time_limit
from ual.types import (
    FollowPathRequest,
    GoToWaypointGeoRequest,
    GoToWaypointRequest,
    LandRequest,
    MotionRequest,
    RecoverFromManualRequest,
    ReturnToLaunchRequest,
    TakeOffRequest,
    TaskRequest,
)
from ual_ros2 import values
from ual_ros2.services.fields import Fields

TASKS: Mapping[type, tuple[str, Any, Any, Callable[..., Fields]]] = {
    TakeOffRequest: ("take_off", srv.TakeOff, action.TakeOff, ask_take_off),
    LandRequest: ("land", srv.Land, action.Land, ask_land),
    GoToWaypointRequest: ("go_to_waypoint", srv.GoToWaypoint, action.GoToWaypoint, ask_go_to_waypoint),
    GoToWaypointGeoRequest: (
        "go_to_waypoint_geo",
        srv.GoToWaypointGeo,
        action.GoToWaypointGeo,
        ask_go_to_waypoint_geo,
    ),
    FollowPathRequest: ("follow_path", None, action.FollowPath, ask_follow_path),
    ReturnToLaunchRequest: ("return_to_launch", srv.ReturnToLaunch, action.ReturnToLaunch, ask_return_to_launch),
}
"""The name of each task, its service, its action, and what makes their fields."""


def inexpressible(member: str) -> NoReturn:
    """Says that ROS has nothing for a member."""
    raise InexpressibleError(member)


class RosUav(ServiceMembers):
    """One UAV of a node."""

    def __init__(self, client: Client, ns: str, now_s: Callable[[], float], *, is_simulated: bool = True) -> None:
        self._client = client
        self._ns = ns
        self._asking = Asking(client, ns, self._call, self._trigger)
        self._services = ServicesOverRos(self._asking, self._fly_mission)
        self._is_simulated = is_simulated
        self._now_s = now_s
        self._told = ReportedSample(client, ns)
        self._asked = LatchedTopics(client, ns)
        self._setpoints = Setpoints(client, ns, self._call)
        waited(lambda: self.telemetry().transform is not None)

    # --- What is known ------------------------------------------------------------------------------------------------

    @property
    def ns(self) -> str:
        return self._ns

    def close(self) -> None:
        """Does nothing: the client in ROS ends all."""

    def info(self) -> ual.Info:
        return self._asked.info()

    def telemetry(self) -> ual.Telemetry:
        return self._told.sample(self._now_s())

    def subscribe(self, callback: Callable[[ual.Telemetry], None], rate_hz: float = 0.0) -> Subscribed:
        if rate_hz:
            inexpressible("rate_hz")
        return Subscribed(self._told, callback)

    def transform(self, target_frame_id: str = "", source_frame_id: str = "") -> ual.Transform:
        return self._told.transform(target_frame_id or "map", source_frame_id or f"{self.ns}/base_link")

    def frames(self) -> list[ual.Frame]:
        return [read_frame(each) for each in self._call(srv.ListFrames, "list_frames").frames]

    @property
    def simulation(self) -> Simulation:
        if not self._is_simulated:
            raise ual.NotSupportedError("the services of a simulation are not there")
        found: Simulation = self._services.simulation
        return found

    # --- Commands -----------------------------------------------------------------------------------------------------

    def _begin(self, request: TaskRequest, blocking: bool, timeout_s: float | None) -> Task:
        """Begins by the service where that waits and has all fields, else by the action, so that both are flown."""
        self._setpoints.settle()
        name, service, kind, _ = TASKS[type(request)]
        limit_s, fields = time_limit(timeout_s), _fields(request)
        if blocking and limit_s is None and service is not None:
            there = service.Request.get_fields_and_field_types()
            if not any(each for field, each in fields.items() if field not in there):
                given = {field: each for field, each in fields.items() if field in there}
                answer = self._asking.ask(service, name, **given, blocking=True)
                return RosTask(self._call, answer.task_id, ual.TaskKind[name.upper()])
        goal = self._asking.filled(kind.Goal, fields)
        manoeuvre = ActionGoal(self._client, self._call, kind, self.ns, name, goal)
        if limit_s is not None:
            manoeuvre.wait_or_cancel(limit_s)
        elif blocking:
            manoeuvre.wait()
        else:
            manoeuvre.wait_until_begun()
        return manoeuvre

    def set_home(self, set_z: bool = False) -> None:
        self._call(srv.SetHome, "set_home", set_z=set_z)

    def abort(self, freeze: bool = False) -> None:
        self._setpoints.settle()
        self._call(srv.Abort, "abort", freeze=freeze)

    def arm(self, *, timeout_s: float | None = None) -> None:
        self._trigger("arm", timeout_s)

    def disarm(self, *, timeout_s: float | None = None) -> None:
        self._trigger("disarm", timeout_s)

    def recover_from_manual(self, *, force: bool = False, timeout_s: float | None = None) -> None:
        if timeout_s is not None:
            inexpressible("timeout_s")
        self._call(srv.TakeControl, "take_control", force=force)

    def pause(self) -> None:
        self._trigger("pause")

    def resume(self) -> None:
        self._trigger("resume")

    def set_pose(self, pose: ual.PoseStamped | ual.Pose) -> None:
        self._setpoints.set_pose(stamped_pose(pose))

    def set_velocity(self, velocity: ual.TwistStamped | ual.Twist) -> None:
        self._setpoints.set_velocity(stamped_twist(velocity))

    def set_external_pose(
        self,
        pose: ual.PoseStamped | ual.Pose,
        *,
        position_std_dev_m: float | None = None,
        orientation_std_dev_rad: float | None = None,
    ) -> None:
        self._setpoints.set_external_pose(stamped_pose(pose), position_std_dev_m, orientation_std_dev_rad)

    def geofence(self) -> ual.types.Geofence:
        return self._asked.geofence()

    def route(self) -> ual.types.Route | None:
        told = self._call(srv.GetRoute, "get_route")
        if not told.is_flown:
            return None
        points = tuple(values.vector(each.pose.position) for each in told.route.poses)
        return ual.types.Route(told.route.header.frame_id, points, told.task_id, told.is_goal_moving)

    def add_frame(self, transform: ual.Transform) -> None:
        self._asking.ask(srv.AddFrame, "add_frame", **ask_add_frame(transform=transform))
        self._told.wait_for_frame(transform)

    def remove_frame(self, frame_id: str) -> None:
        self._call(srv.RemoveFrame, "remove_frame", frame_id=frame_id)

    def lease_info(self) -> ual.types.LeaseInfo | None:
        return self._asked.lease()

    def task(self, task_id: str) -> Task:
        return RosTask(self._call, task_id, info_of(self._call, task_id).kind)

    @property
    def dry_run(self) -> DryRun[ual.types.Plan]:
        return DryRun(self._plan)

    def _plan(self, motion: MotionRequest) -> ual.types.Plan:
        match motion:
            case ual.PoseStamped():
                self._setpoints.ask_pose(motion)
            case ual.TwistStamped():
                self._setpoints.ask_velocity(motion)
            case RecoverFromManualRequest(force):
                self._call(srv.TakeControl, "take_control", force=force, dry_run=True)
            case _:
                return self._plan_of_task(motion)
        return ual.types.Plan()

    def _plan_of_task(self, request: TaskRequest) -> ual.types.Plan:
        name, _, kind, _ = TASKS[type(request)]
        goal = self._asking.filled(kind.Goal, _fields(request))
        _, result = self._client.fly(kind, f"/{self.ns}/ual/{name}", **goal, dry_run=True)
        if not result.success:
            raise error_of(result)
        return read_plan(result.plan)

    def _call(self, kind: Any, name: str, /, **fields: Any) -> Any:
        answer = self._client.call(kind, f"/{self.ns}/ual/{name}", **fields)
        if not answer.success:
            raise error_of(answer)
        return answer

    def _trigger(self, name: str, timeout_s: float | None = None) -> None:
        if timeout_s is not None:
            inexpressible("timeout_s")
        self._setpoints.settle()
        answer = self._client.call(Trigger, f"/{self.ns}/ual/{name}")
        if not answer.success:
            text, _, metadata = answer.message.partition("\n")
            reason, _, message = text.partition(": ")
            raise ual.errors.from_reason(reason, message, json.loads(metadata or "{}"))

    def _fly_mission(self, fields: Mapping[str, Any]) -> ual.TaskInfo:
        manoeuvre = ActionGoal(self._client, self._call, action.FlyMission, self.ns, "fly_mission", fields)
        manoeuvre.wait_until_begun()
        return manoeuvre.info()

    # --- What ROS has nothing for -------------------------------------------------------------------------------------

    def lease(self, holder: str = "", *, take: bool = False) -> Lease:
        inexpressible("lease")

    def extension(self, name: str) -> Any:
        inexpressible("extension")


class Subscribed:
    """A subscription to the samples."""

    def __init__(self, told: ReportedSample, callback: Callable[[ual.Telemetry], None]) -> None:
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


def _fields(request: TaskRequest) -> Fields:
    """The fields of a goal."""
    given = {each.name: getattr(request, each.name) for each in fields_of(request)}
    if isinstance(place := given.get("waypoint"), ual.GeoWaypoint):
        given |= {each.name: getattr(place, each.name) for each in fields_of(place)}
        del given["waypoint"]
    return TASKS[type(request)][3](**given)
