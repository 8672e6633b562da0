"""A `ual.interface.Uav` that knows its UAV by ROS only: by services, actions and topics of the node, and by tf.

What ROS has nothing for raises `InexpressibleError`. One thing is not ROS' part and is given: the time of the simulated
world. `ros_beside` has the services beside flying.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any, NoReturn

from asked import Asked
from derived_values import read_frame, read_plan
from flying import Client, waited
from geometry_msgs.msg import PointStamped, TransformStamped
from inexpressible import InexpressibleError
from nav_msgs.msg import Path
from reading import error_of
from ros_beside import Asking, Beside
from ros_setpoints import Setpoints, pose_message
from ros_tasks import KnownTask, Manoeuvre, info_of
from sensor_msgs.msg import NavSatFix
from std_srvs.srv import Trigger
from telling import Told
from typing_extensions import Self
from ual_msgs import action, msg, srv

import ual
from ual.geometry import stamped_pose, stamped_twist
from ual.interface import DryRun, Lease, Simulation, Task, Uav
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

NAMES: Mapping[type, str] = {
    TakeOffRequest: "take_off",
    LandRequest: "land",
    GoToWaypointRequest: "go_to_waypoint",
    GoToWaypointGeoRequest: "go_to_waypoint_geo",
    FollowPathRequest: "follow_path",
    ReturnToLaunchRequest: "return_to_launch",
}


def inexpressible(member: str) -> NoReturn:
    """Says that ROS has nothing for a member."""
    raise InexpressibleError(member)


class RosUav(Uav):
    """One UAV of a node."""

    def __init__(self, client: Client, ns: str, now_s: Callable[[], float], *, is_simulated: bool = True) -> None:
        self._client = client
        self._ns = ns
        self._beside = Beside(Asking(client, ns, self._call, self._trigger), self._fly_mission)
        self._is_simulated = is_simulated
        self._now_s = now_s
        self._told = Told(client, ns)
        self._asked = Asked(client, ns)
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
        return self._beside.simulation

    # --- Commands -----------------------------------------------------------------------------------------------------

    def _begin(self, request: TaskRequest, blocking: bool, timeout_s: float | None) -> Task:
        """Begins by the service where that waits and has all fields, else by the action, so that both are flown."""
        self._setpoints.settle()
        name, limit_s = NAMES[type(request)], time_limit(timeout_s)
        service = _service(request)
        if blocking and limit_s is None and service is not None:
            kind, fields = service
            answer = self._call(kind, name, **fields, blocking=True)
            return KnownTask(self._call, answer.task_id, ual.TaskKind[name.upper()])
        kind, fields = _goal(request)
        manoeuvre = Manoeuvre(self._client, self._call, kind, self.ns, name, fields)
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
        message = TransformStamped()
        values.fill_transform(message, transform)
        message.header.stamp.sec, message.header.stamp.nanosec = values.split(transform.stamp_s)
        self._call(srv.AddFrame, "add_frame", transform=message)
        self._told.wait_for_frame(transform)

    def remove_frame(self, frame_id: str) -> None:
        self._call(srv.RemoveFrame, "remove_frame", frame_id=frame_id)

    def lease_info(self) -> ual.types.LeaseInfo | None:
        return self._asked.lease()

    def task(self, task_id: str) -> Task:
        return KnownTask(self._call, task_id, info_of(self._call, task_id).kind)

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
        kind, fields = _goal(request)
        name = f"/{self.ns}/ual/{NAMES[type(request)]}"
        _, result = self._client.fly(kind, name, **fields, dry_run=True)
        if not result.success:
            raise error_of(result)
        return read_plan(result.plan)

    @property
    def parameters(self) -> ual.interface.Parameters:
        return self._beside.parameters

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

    # --- What is beside flying ----------------------------------------------------------------------------------------

    @property
    def cameras(self) -> ual.interface.Cameras:
        return self._beside.cameras

    @property
    def gimbals(self) -> ual.interface.Gimbals:
        return self._beside.gimbals

    @property
    def mission(self) -> ual.interface.Mission:
        return self._beside.mission

    @property
    def gripper(self) -> ual.interface.Gripper:
        return self._beside.gripper

    @property
    def fence(self) -> ual.interface.Fence:
        return self._beside.fence

    @property
    def logs(self) -> ual.interface.Logs:
        return self._beside.logs

    @property
    def corrections(self) -> ual.interface.Corrections:
        return self._beside.corrections

    def _fly_mission(self, fields: Mapping[str, Any]) -> ual.TaskInfo:
        manoeuvre = Manoeuvre(self._client, self._call, action.FlyMission, self.ns, "fly_mission", fields)
        manoeuvre.wait_until_begun()
        return manoeuvre.info()

    # --- What ROS has nothing for -------------------------------------------------------------------------------------

    def lease(self, holder: str = "", *, take: bool = False) -> Lease:
        inexpressible("lease")

    def extension(self, name: str) -> Any:
        inexpressible("extension")


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
            return srv.GoToWaypoint, {"waypoint": pose_message(waypoint)}
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
            return action.GoToWaypoint, {"waypoint": pose_message(waypoint), "max_speed": max_speed_m_s or 0.0}
        case GoToWaypointGeoRequest(place, max_speed_m_s):
            yaw = {} if place.yaw_rad is None else {"has_yaw": True, "yaw": place.yaw_rad}
            return action.GoToWaypointGeo, {**_geo(place), **yaw, "max_speed": max_speed_m_s or 0.0}
        case FollowPathRequest():
            return action.FollowPath, _path(request)
        case ReturnToLaunchRequest(return_height_m):
            return action.ReturnToLaunch, {"height": return_height_m or 0.0}


def _geo(place: ual.GeoWaypoint) -> dict[str, Any]:
    fix = NavSatFix(latitude=place.latitude_deg, longitude=place.longitude_deg, altitude=place.altitude_m)
    return {"waypoint": fix, "altitude_reference": place.altitude_reference.value}


def _path(request: FollowPathRequest) -> dict[str, Any]:
    fields: dict[str, Any] = {
        "path": Path(poses=[pose_message(each) for each in request.waypoints if isinstance(each, ual.PoseStamped)]),
        "geo_waypoints": [_place(each) for each in request.waypoints if isinstance(each, ual.GeoWaypoint)],
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


def _place(waypoint: ual.GeoWaypoint) -> Any:
    yaw_rad = waypoint.yaw_rad
    return msg.GeoWaypoint(**_geo(waypoint), has_yaw=yaw_rad is not None, yaw=0.0 if yaw_rad is None else yaw_rad)
