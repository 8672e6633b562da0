"""A team's members that are one call each. ``make clients`` writes this file: do not edit it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Coroutine
from typing import Any, TypeVar

from ual import aio
from ual.geometry import Pose, PoseStamped, Transform, Twist, TwistStamped
from ual.types import Frame, Geofence, Info, LeaseInfo, Odometry, Route, State, Telemetry

T = TypeVar("T")


class TeamMembers(ABC):
    """Members of `ual.Team`."""

    _team: aio.Team

    @abstractmethod
    def _wait(self, coroutine: Coroutine[Any, Any, T]) -> T:
        """Runs a coroutine of the asynchronous team to its end."""

    def info(self) -> dict[str, Info]:
        """Returns the identity of the UAV and its capabilities: backend, autopilot, capabilities, limits.

        See `ual.interface.Uav.info`.

        """
        return self._wait(self._team.info())

    def telemetry(self) -> dict[str, Telemetry]:
        """Returns the newest sample of everything known. What is not known is None.

        See `ual.interface.Uav.telemetry`.

        """
        return self._wait(self._team.telemetry())

    def state(self) -> dict[str, State]:
        """Returns the state, estimated from the newest data of the autopilot.

        See `ual.interface.Uav.state`.

        """
        return self._wait(self._team.state())

    def wait_for(self, *states: State, timeout_s: float | None = None) -> dict[str, State]:
        """Blocks until the UAV is in one of some states, and returns that one. It returns at once if it is already.

        See `ual.interface.Uav.wait_for`.

        """
        return self._wait(self._team.wait_for(*states, timeout_s=timeout_s))

    def is_ready(self) -> dict[str, bool]:
        """Returns True when the state is not UNINITIALIZED.

        See `ual.interface.Uav.is_ready`.

        """
        return self._wait(self._team.is_ready())

    def is_idle(self) -> dict[str, bool]:
        """Returns True when no task runs.

        See `ual.interface.Uav.is_idle`.

        """
        return self._wait(self._team.is_idle())

    def pose(self) -> dict[str, PoseStamped]:
        """Returns the pose of the body, in ``<ns>/odom`` or in the configured `pose_frame_id`.

        See `ual.interface.Uav.pose`.

        """
        return self._wait(self._team.pose())

    def velocity(self) -> dict[str, TwistStamped]:
        """Returns the velocity in m/s and rad/s, along the axes of the frame of `pose`.

        See `ual.interface.Uav.velocity`.

        """
        return self._wait(self._team.velocity())

    def odometry(self) -> dict[str, Odometry]:
        """Returns the pose in ``<ns>/odom`` with the velocity along the axes of the body.

        See `ual.interface.Uav.odometry`.

        """
        return self._wait(self._team.odometry())

    def reference_pose(self) -> dict[str, PoseStamped | None]:
        """Returns where the UAV is commanded to be now; None while no pose is commanded.

        See `ual.interface.Uav.reference_pose`.

        """
        return self._wait(self._team.reference_pose())

    def transform(self, target_frame_id: str = "", source_frame_id: str = "") -> dict[str, Transform]:
        """Returns what takes coordinates in the source frame to the target frame.

        See `ual.interface.Uav.transform`.

        """
        return self._wait(self._team.transform(target_frame_id=target_frame_id, source_frame_id=source_frame_id))

    def frames(self) -> dict[str, list[Frame]]:
        """Returns all frames, each with its parent.

        See `ual.interface.Uav.frames`.

        """
        return self._wait(self._team.frames())

    def geofence(self) -> dict[str, Geofence]:
        """Returns where the UAV may fly now: the geofence, the floor, the ceiling, and the autopilot's own fence.

        See `ual.interface.Uav.geofence`.

        """
        return self._wait(self._team.geofence())

    def route(self) -> dict[str, Route | None]:
        """Returns the way of the running task, or to the goal of `set_pose` in a frame that moves.

        See `ual.interface.Uav.route`.

        """
        return self._wait(self._team.route())

    def add_frame(self, transform: Transform) -> None:
        """Adds a frame, or moves one that was added. A frame may be moved often (50 Hz).

        See `ual.interface.Uav.add_frame`.

        """
        self._wait(self._team.add_frame(transform))

    def remove_frame(self, frame_id: str) -> None:
        """Removes a frame that was added. A UAV that follows a goal in it (a frame that moves) stops.

        See `ual.interface.Uav.remove_frame`.

        """
        self._wait(self._team.remove_frame(frame_id))

    def set_home(self, set_z: bool = False) -> None:
        """Makes the present position the origin of ``<ns>/odom``. Allowed in LANDED_DISARMED and LANDED_ARMED.

        See `ual.interface.Uav.set_home`.

        """
        self._wait(self._team.set_home(set_z))

    def arm(self, *, timeout_s: float | None = None) -> None:
        """Arms the motors, and returns when the autopilot says that they are. Allowed in LANDED_DISARMED.

        See `ual.interface.Uav.arm`.

        """
        self._wait(self._team.arm(timeout_s=timeout_s))

    def disarm(self, *, timeout_s: float | None = None) -> None:
        """Disarms the motors, and returns when the autopilot says that they are. Allowed in LANDED_ARMED.

        See `ual.interface.Uav.disarm`.

        """
        self._wait(self._team.disarm(timeout_s=timeout_s))

    def lease_info(self) -> dict[str, LeaseInfo | None]:
        """Returns the holder of the lease; None where there is no lease.

        See `ual.interface.Uav.lease_info`.

        """
        return self._wait(self._team.lease_info())

    def set_pose(self, pose: PoseStamped | Pose) -> None:
        """Sends a pose as the reference, as it is: no straight line, no smoothing. Allowed in FLYING_AUTO.

        See `ual.interface.Uav.set_pose`.

        """
        self._wait(self._team.set_pose(pose))

    def set_velocity(self, velocity: TwistStamped | Twist) -> None:
        """Sends a velocity as the reference. Allowed in FLYING_AUTO.

        See `ual.interface.Uav.set_velocity`.

        """
        self._wait(self._team.set_velocity(velocity))

    def recover_from_manual(self, *, force: bool = False, timeout_s: float | None = None) -> None:
        """Takes control back from the safety pilot, and holds the pose found. Allowed in FLYING_MANUAL.

        See `ual.interface.Uav.recover_from_manual`.

        """
        self._wait(self._team.recover_from_manual(force=force, timeout_s=timeout_s))

    def abort(self, freeze: bool = False) -> None:
        """Cancels the task or reference, and stops the UAV. Allowed in FLYING_AUTO. Returns at once.

        See `ual.interface.Uav.abort`.

        """
        self._wait(self._team.abort(freeze))

    def pause(self) -> None:
        """Brakes on the way of the running task and holds there. Allowed in FLYING_AUTO. Returns at once.

        See `ual.interface.Uav.pause`.

        """
        self._wait(self._team.pause())

    def resume(self) -> None:
        """Goes on with the paused task, along the rest of its way. Allowed in FLYING_AUTO. Returns at once.

        See `ual.interface.Uav.resume`.

        """
        self._wait(self._team.resume())
