"""The commands that are sent as they are: `set_pose` and `set_velocity`.

Each setpoint takes the same path: validate, resolve the frame, check the state, scale to the limits, check the
geofence, send. A stream sends 50 setpoints a second, so each check is made only once.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias, TypeVar

from ual.errors import UalError
from ual.geometry import PoseStamped, Twist, TwistStamped, stamped_twist
from ual.types import Capability, Plan, State
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.flight import CommandOrigin, Flight
from ual_daemon.flight.policy.lease import NOBODY
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.tracker import limits
from ual_daemon.tracker.references import VELOCITY_TIMEOUT_S, Hold, Reference, Velocity
from ual_daemon.trajectory import PathWaypoint
from ual_daemon.vehicle.admission import admit
from ual_daemon.vehicle.distance_limit import DistanceLimit
from ual_daemon.vehicle.moving_goals import moving_goal
from ual_daemon.vehicle.preconditions import Preconditions

T = TypeVar("T")

_Make: TypeAlias = Callable[[T, str], tuple[Reference, Snapshot]]
"""Makes the reference of a setpoint that is given by a lease, and returns it with the snapshot that allows it."""


class VehicleSetpoints:
    """The setpoints of one UAV. Any thread may call. A setpoint has been sent when its call returns.

    `lease_id` is the lease by which a setpoint is given.
    """

    def __init__(
        self, flight: Flight, resolver: FrameResolver, preconditions: Preconditions, distance_limit: DistanceLimit
    ) -> None:
        self._flight = flight
        self._distance_limit = distance_limit
        self._resolver = resolver
        self._preconditions = preconditions
        self._odom = ("", resolver.tree.odom)

    def set_pose(self, pose: PoseStamped, lease_id: str = NOBODY) -> None:
        """Sends a pose. See `ual.interface.Uav.set_pose` for the errors."""
        self._send("set_pose", self._pose, pose, lease_id)

    def set_velocity(self, velocity: TwistStamped | Twist, lease_id: str = NOBODY) -> None:
        """Sends a velocity. See `ual.interface.Uav.set_velocity` for the errors."""
        # A stream goes on within what the rules have admitted. What is new, turns with the body, or is near a bound is
        # assessed by each of them.
        twist: object = velocity
        if twist.__class__ is not Twist and isinstance(velocity, TwistStamped) and velocity.frame_id in self._odom:
            twist = velocity.twist
        if twist.__class__ is not Twist or not self._flight.renew_velocity(twist, lease_id):
            stamped = stamped_twist(velocity) if isinstance(velocity, Twist) else velocity
            self._send("set_velocity", self._velocity, stamped, lease_id)

    def plan_pose(self, pose: PoseStamped, lease_id: str = NOBODY) -> Plan:
        """Makes a dry run of `set_pose`: raises the same errors, but sends nothing."""
        return self._plan("set_pose", self._pose, pose, lease_id)

    def plan_velocity(self, velocity: TwistStamped, lease_id: str = NOBODY) -> Plan:
        """Makes a dry run of `set_velocity`: raises the same errors, but sends nothing."""
        return self._plan("set_velocity", self._velocity, velocity, lease_id)

    def _send(self, name: str, make: _Make[T], setpoint: T, lease_id: str) -> None:
        # A try, not `logging_refusal`: a context manager costs each setpoint of a stream some microseconds.
        try:
            reference, snapshot = make(setpoint, lease_id)
            self._flight.geofence.admit(name, reference, self._flight.limits.get(), snapshot)
            # This raises where a manoeuvre may not be replaced.
            self._flight.begin_reference(reference, name, snapshot, CommandOrigin(lease_id))
        except UalError as error:
            self._preconditions.log_refusal(name, error)
            raise

    def _plan(self, name: str, make: _Make[T], setpoint: T, lease_id: str) -> Plan:
        with self._preconditions.logging_refusal(name):
            reference, snapshot = make(setpoint, lease_id)
            return admit(self._flight, name, reference, snapshot)

    def _pose(self, pose: PoseStamped, lease_id: str) -> tuple[Reference, Snapshot]:
        """Returns the reference of a pose, and the snapshot in which the state allows it."""
        self._preconditions.require_capability(Capability.POSITION, "set_pose")
        goal = self._resolver.goal(pose, "pose")
        snapshot = self._preconditions.require_state("set_pose", lease_id, State.FLYING_AUTO)
        if self._resolver.is_moving(goal):  # within the limits, wherever it moves
            reference = moving_goal(
                self._flight, self._resolver, self._distance_limit, goal, self._flight.limits.get, snapshot
            )
            there = PathWaypoint(reference.goal(snapshot.time_s).position)
            self._distance_limit.require_goal("set_pose", goal, there, snapshot)
            return reference, snapshot
        local = self._resolver.to_local(goal, snapshot)
        self._distance_limit.require_goal("set_pose", goal, local, snapshot)
        yaw_rad = self._flight.start(snapshot).yaw_rad if local.yaw_rad is None else local.yaw_rad
        return Hold(local.position, yaw_rad), snapshot

    def _velocity(self, velocity: TwistStamped, lease_id: str) -> tuple[Reference, Snapshot]:
        """Returns the reference of a velocity, and the snapshot in which the state allows it."""
        self._preconditions.require_capability(Capability.VELOCITY, "set_velocity")
        twist, frame_id = self._resolver.velocity(velocity, "velocity")
        snapshot = self._preconditions.require_state("set_velocity", lease_id, State.FLYING_AUTO)
        in_body = frame_id == self._resolver.tree.body
        if not in_body:
            twist = self._resolver.velocity_to_local(twist, frame_id, snapshot)
        scaled = limits.scaled_down(twist, self._flight.limits.get())
        expires_s = snapshot.time_s + VELOCITY_TIMEOUT_S
        return Velocity(scaled, self._flight.drift, in_body=in_body, expires_s=expires_s), snapshot
