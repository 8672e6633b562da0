"""The members that are one call each, for asyncio. ``make clients`` writes this file: do not edit it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TypeVar

from ual import _calls
from ual._calls import Call
from ual._service_calls import simulation as _simulation_calls
from ual._service_calls import uav as _uav_calls
from ual.aio._connection import Connection
from ual.aio._setpoints import Setpoints
from ual.geometry import Pose, PoseStamped, Transform, Twist, TwistStamped, Vector3
from ual.shared import views
from ual.simulation import Fault, SimulationPart
from ual.types import Frame, Geofence, Info, LeaseInfo, Odometry, Route, State, Telemetry

T = TypeVar("T")


class UavMembers(ABC):
    """Members of `ual.aio.Uav`."""

    _connection: Connection
    _setpoints: Setpoints
    _external_poses: Setpoints

    @abstractmethod
    async def _command(self, call: Call[T], timeout_s: float | None = None) -> T:
        """Makes a call that comes after the setpoints given before it."""

    async def info(self) -> Info:
        """Returns the identity of the UAV and its capabilities: backend, autopilot, capabilities, limits."""
        return await self._connection.run(_uav_calls.info())

    async def telemetry(self) -> Telemetry:
        """Returns the newest sample of everything known. What is not known is None."""
        return await self._connection.run(_uav_calls.telemetry())

    async def state(self) -> State:
        """Returns the state, estimated from the newest data of the autopilot."""
        return views.state(await self.telemetry())

    async def is_ready(self) -> bool:
        """Returns True when the state is not UNINITIALIZED."""
        return views.is_ready(await self.telemetry())

    async def is_idle(self) -> bool:
        """Returns True when no task runs."""
        return views.is_idle(await self.telemetry())

    async def pose(self) -> PoseStamped:
        """Returns the pose of the body, in ``<ns>/odom`` or in the configured `pose_frame_id`.

        Raises:
            WrongStateError: The pose is not known (yet).
            FrameLostError: It is not known any more where the frame is.

        """
        return views.pose(await self.telemetry())

    async def velocity(self) -> TwistStamped:
        """Returns the velocity in m/s and rad/s, along the axes of the frame of `pose`.

        Raises:
            WrongStateError: The velocity is not known (yet).

        """
        return views.velocity(await self.telemetry())

    async def odometry(self) -> Odometry:
        """Returns the pose in ``<ns>/odom`` with the velocity along the axes of the body.

        Raises:
            WrongStateError: The odometry is not known (yet).
            FrameLostError: It is not known any more where the frame is.

        """
        return views.odometry(await self.telemetry())

    async def reference_pose(self) -> PoseStamped | None:
        """Returns where the UAV is commanded to be now; None while no pose is commanded."""
        return views.reference_pose(await self.telemetry())

    async def transform(self, target_frame_id: str = "", source_frame_id: str = "") -> Transform:
        """Returns what takes coordinates in the source frame to the target frame.

        Args:
            target_frame_id: Default ``map``.
            source_frame_id: Default ``<ns>/base_link``, the body.

        Raises:
            UnknownFrameError: There is no such frame; the known ones are listed.
            WrongStateError: It is not known yet where one of them is.
            FrameLostError: It is not known any more where the frame is.

        """
        return await self._connection.run(
            _uav_calls.transform(target_frame_id=target_frame_id, source_frame_id=source_frame_id)
        )

    async def frames(self) -> list[Frame]:
        """Returns all frames, each with its parent."""
        return await self._connection.run(_uav_calls.frames())

    async def geofence(self) -> Geofence:
        """Returns where the UAV may fly now: the geofence, the floor, the ceiling, and the autopilot's own fence.

        Raises:
            WrongStateError: It is not known where they lie.
            FrameLostError: It is not known any more.

        """
        return await self._connection.run(_uav_calls.geofence())

    async def route(self) -> Route | None:
        """Returns the way of the running task, or to the goal of `set_pose` in a frame that moves.

        None where nothing is flown whose way is known: of a landing, which the autopilot flies, or of a velocity.

        Raises:
            WrongStateError: It is not known where the UAV's local frame lies in ``map``.
            FrameLostError: It is not known any more.
            ResourceExhaustedError: Too many ask at once.

        """
        return await self._connection.run(_uav_calls.route())

    async def add_frame(self, transform: Transform) -> None:
        """Adds a frame, or moves one that was added. A frame may be moved often (50 Hz).

        Args:
            transform: Where the frame `child_frame_id` lies in its parent `frame_id` (empty: ``map``). `stamp_s` is
                when it was there, 0 where that is not known.

        Raises:
            InvalidArgumentError: The name is none, the frame is not the caller's to move, or the transform is none.
            UnknownFrameError: There is no such parent.
            ResourceExhaustedError: There would be too many frames, or too many levels of them.

        """
        await self._connection.run(_uav_calls.add_frame(transform))

    async def remove_frame(self, frame_id: str) -> None:
        """Removes a frame that was added. A UAV that follows a goal in it (a frame that moves) stops.

        Raises:
            UnknownFrameError: There is no such frame.
            InvalidArgumentError: The frame is built in or configured, or other frames lie below it.

        """
        await self._connection.run(_uav_calls.remove_frame(frame_id))

    async def set_home(self, set_z: bool = False) -> None:
        """Makes the present position the origin of ``<ns>/odom``. Allowed in LANDED_DISARMED and LANDED_ARMED.

        Args:
            set_z: Whether the height becomes 0, too.

        Raises:
            WrongStateError: The UAV is not on the ground.

        """
        await self._command(_uav_calls.set_home(set_z))

    async def arm(self, *, timeout_s: float | None = None) -> None:
        """Arms the motors, and returns when the autopilot says that they are. Allowed in LANDED_DISARMED.

        Raises:
            PermissionDeniedError: Arming a real UAV belongs to its safety pilot (see ``--allow-arming``).
            WrongStateError: The UAV is not disarmed on the ground.
            RejectedByAutopilotError: The autopilot refused; its own words are in the message.
            UalTimeoutError: It was not armed within `timeout_s`.

        """
        await self._command(_uav_calls.arm(), timeout_s)

    async def disarm(self, *, timeout_s: float | None = None) -> None:
        """Disarms the motors, and returns when the autopilot says that they are. Allowed in LANDED_ARMED.

        Raises:
            PermissionDeniedError: As in `arm`.
            WrongStateError: The UAV is not armed on the ground.
            RejectedByAutopilotError: The autopilot refused.
            UalTimeoutError: It was not disarmed within `timeout_s`.

        """
        await self._command(_uav_calls.disarm(), timeout_s)

    async def lease_info(self) -> LeaseInfo | None:
        """Returns the holder of the lease; None where there is no lease."""
        return await self._connection.run(_uav_calls.lease_info())

    async def set_pose(self, pose: PoseStamped | Pose) -> None:
        """Sends a pose as the reference, as it is: no straight line, no smoothing. Allowed in FLYING_AUTO.

        Returns at once. The pose is kept until another command comes.

        Args:
            pose: Where to be: metres, z up. A bare `Pose` is in ``<ns>/odom``. A quaternion of all zeros keeps the
                heading.

        Raises:
            WrongStateError: The UAV does not fly by references of UAL.
            FrameLostError: It is not known any more where the frame is (an autopilot that rebooted indoors).
            InvalidArgumentError: A value is not finite, or out of range; the field is named.
            UnknownFrameError: There is no such frame.
            GeofenceError: The pose lies outside the geofence.

        """
        await self._setpoints.send(_calls.set_pose(pose))

    async def set_velocity(self, velocity: TwistStamped | Twist) -> None:
        """Sends a velocity as the reference. Allowed in FLYING_AUTO.

        Returns at once. Without a new one within 0.5 s the UAV stops and holds its position. What is 0 in it (an
        axis, the height, the heading) is held.

        Args:
            velocity: m/s, and rad/s about z. A bare `Twist` is along the axes of ``<ns>/odom``. One in
                ``<ns>/base_link`` turns with the body. Beyond the limits of the UAV it is scaled down, its direction
                kept.

        Raises:
            WrongStateError: The UAV does not fly by references of UAL.
            FrameLostError: It is not known any more where the frame is (an autopilot that rebooted indoors).
            InvalidArgumentError: A value is not finite, or out of range; the field is named.
            UnknownFrameError: There is no such frame.
            GeofenceError: The UAV could not stop inside the geofence any more.

        """
        await self._setpoints.send(_calls.set_velocity(velocity))

    async def set_external_pose(
        self,
        pose: PoseStamped | Pose,
        *,
        position_std_dev_m: float | None = None,
        orientation_std_dev_rad: float | None = None,
    ) -> None:
        """Gives the autopilot a pose of the UAV that was measured from outside: motion capture, vision, Lighthouse.

        Allowed in every state; it commands nothing. Returns at once. Poses are to come at 20 Hz or more, each as soon
        as it is measured: an autopilot without satellites that gets none for a moment loses its position.

        A jump that no vehicle flies is dropped, and the log of the daemon says so. So is a pose that is old, unless it
        is the first within 0.5 s, which is refused.

        Args:
            pose: Where the UAV is, with its whole orientation. `PoseStamped.stamp_s` is when it was measured, in UTC;
                0: just now. In ``map``, or a frame below it that is not below ``<ns>/odom``, it is a place in the
                autopilot's local frame as that was before any `set_home`. The autopilot may have no position yet.
                In ``<ns>/odom``, or below it, while nothing ties that to Earth: as it was at the first such pose.
            position_std_dev_m: The standard deviation in each axis, in metres. None where it is not known.
            orientation_std_dev_rad: The standard deviation about each axis, in radians. None where it is not known.

        Raises:
            InvalidArgumentError: A value is not finite or out of range, the orientation is no rotation, or the pose is
                older than 0.2 s or in the future.
            UnknownFrameError: There is no such frame.
            WrongStateError: It is not known where the frame is.
            NotSupportedError: The autopilot takes no poses from outside.

        """
        await self._external_poses.send(
            _calls.set_external_pose(
                pose, position_std_dev_m=position_std_dev_m, orientation_std_dev_rad=orientation_std_dev_rad
            )
        )

    async def recover_from_manual(self, *, force: bool = False, timeout_s: float | None = None) -> None:
        """Takes control back from the safety pilot, and holds the pose found. Allowed in FLYING_MANUAL.

        Returns when the state is FLYING_AUTO. On the ground (LANDED_ARMED), after others have flown, it sends nothing,
        and allows a take-off again.

        Args:
            force: Whether to take control although a failsafe of the autopilot is active, or flies: its return or
                landing is then ended.
            timeout_s: How long to wait, in seconds.

        Raises:
            WrongStateError: The UAV is not flown by others, or a failsafe is active (the metadata `by` names it).
            RejectedByAutopilotError: The autopilot refused.
            UalTimeoutError: It did not change its mode within `timeout_s`.

        """
        await self._command(_calls.recover_from_manual(force=force), timeout_s)

    async def abort(self, freeze: bool = False) -> None:
        """Cancels the task or reference, and stops the UAV. Allowed in FLYING_AUTO. Returns at once.

        Args:
            freeze: Whether to hold the present position instead of braking to rest ahead of it.

        Raises:
            WrongStateError: The UAV does not fly by references of UAL, or a take-off or landing runs.

        """
        await self._command(_calls.abort(freeze))

    async def pause(self) -> None:
        """Brakes on the way of the running task and holds there. Allowed in FLYING_AUTO. Returns at once.

        The task still runs, but its time limit does not; `TaskInfo.is_paused` is True. Another command, an abort, or
        the safety pilot ends it as usual. Does nothing if the task is paused already.

        Raises:
            WrongStateError: No task runs, or it cannot be paused (a take-off, a landing, a goal that moves).

        """
        await self._command(_calls.pause())

    async def resume(self) -> None:
        """Goes on with the paused task, along the rest of its way. Allowed in FLYING_AUTO. Returns at once.

        Raises:
            WrongStateError: No task runs, or it is not paused.

        """
        await self._command(_calls.resume())


class SimulationMembers:
    """Members of `ual.aio.Uav.simulation`."""

    _connection: Connection

    async def parts(self) -> frozenset[SimulationPart]:
        """Returns the parts that this simulation offers."""
        return await self._connection.run(_simulation_calls.parts())

    async def pilot_arm(self) -> None:
        """Arms, as the safety pilot does. Returns when the UAV is armed."""
        await self._connection.run(_simulation_calls.pilot_arm())

    async def pilot_disarm(self) -> None:
        """Disarms, as the safety pilot does. Returns when the UAV is disarmed."""
        await self._connection.run(_simulation_calls.pilot_disarm())

    async def pilot_take_over(self) -> None:
        """Switches to a mode in which the safety pilot flies. Tasks and references end."""
        await self._connection.run(_simulation_calls.pilot_take_over())

    async def pilot_move_sticks(
        self, *, forward: float = 0.0, left: float = 0.0, up: float = 0.0, turn: float = 0.0
    ) -> None:
        """Moves the sticks, each from -1 to 1, and leaves them there. `turn` is counter-clockwise seen from above."""
        await self._connection.run(_simulation_calls.pilot_move_sticks(forward=forward, left=left, up=up, turn=turn))

    async def pilot_give_back(self) -> None:
        """Switches back to the mode in which the autopilot takes references from UAL."""
        await self._connection.run(_simulation_calls.pilot_give_back())

    async def begin_fault(self, fault: Fault, duration_s: float = 0.0) -> str:
        """Begins a fault, for `duration_s` of the simulation's time (0: until it is ended). Returns its identifier."""
        return await self._connection.run(_simulation_calls.begin_fault(fault=fault, duration_s=duration_s))

    async def end_fault(self, fault_id: str = "") -> None:
        """Ends a fault, or all faults where no identifier is given."""
        await self._connection.run(_simulation_calls.end_fault(fault_id))

    async def faults(self) -> dict[str, Fault]:
        """Returns the faults that are active, by their identifiers."""
        return await self._connection.run(_simulation_calls.faults())

    async def set_speed_factor(self, speed_factor: float) -> None:
        """Sets how fast simulated time passes: 1 as real time, 0 only by `step`."""
        await self._connection.run(_simulation_calls.set_speed_factor(speed_factor))

    async def step(self, duration_s: float) -> None:
        """Lets `duration_s` of simulated time pass. Returns when it has passed. Needs the speed factor 0."""
        await self._connection.run(_simulation_calls.step(duration_s))

    async def set_noise(self, *, position_m: float, velocity_m_s: float) -> None:
        """Sets the noise of the estimate, as standard deviations in metres and metres a second."""
        await self._connection.run(_simulation_calls.set_noise(position_m=position_m, velocity_m_s=velocity_m_s))

    async def set_wind(self, velocity_m_s: Vector3) -> None:
        """Sets the wind: the velocity of the air, east, north and up, in metres a second."""
        await self._connection.run(_simulation_calls.set_wind(velocity_m_s))

    async def place_on_ground(self, position: Vector3, yaw_rad: float = 0.0) -> None:
        """Puts the UAV on the ground at a place, disarmed and at rest. A flight ends.

        Args:
            position: Metres east, north and up of the autopilot's local origin, where ``<ns>/odom`` is before any
                `Uav.set_home`. Where the simulation has a ground of its own, that decides the height.
            yaw_rad: The heading, counter-clockwise from east.

        """
        await self._connection.run(_simulation_calls.place_on_ground(position=position, yaw_rad=yaw_rad))
