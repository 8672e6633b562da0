"""The interface of a UAV: what the class (`ual_daemon.UAL`) and the client (`ual.Uav`) both are.

Any thread may call any member at any time. All errors are those of `ual.errors`; every member may raise `LinkLostError`
while nothing is heard from the autopilot or from the daemon. A pose, velocity or point without a frame is in
``<ns>/odom``. Lengths are in metres, angles in radians, times in seconds; axes are those of REP 103 (x forward, y left,
z up in the body; east, north, up outside).

`timeout_s` is how long the caller waits (None: as long as the command can take). When it passes, the call raises
`UalTimeoutError`. A go-to or path that it waited for is then cancelled, and the UAV holds its position.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from ual.cameras import CameraInfo, CameraMode, CameraStatus, Image, ImageKind, Photo, VideoStream
from ual.corrections import CorrectionsStatus
from ual.errors import InvalidArgumentError, NotSupportedError, UalError
from ual.fences.values import FencePlan, KeptFence
from ual.geometry import (
    PointStamped,
    Pose,
    PoseStamped,
    Transform,
    Twist,
    TwistStamped,
    Vector3,
    stamped_point,
    stamped_pose,
    stamped_twist,
)
from ual.gimbals import GimbalInfo, GimbalReference, GimbalStatus
from ual.gripper import Equipment, WinchAction
from ual.logs.values import Log, LogChunk
from ual.missions.items import Item
from ual.missions.plan import LinkLossAction, MissionPlan, MissionProgress, StoredMission
from ual.parameters.values import Parameter
from ual.shared import views
from ual.shared.time_limit import time_limit
from ual.simulation import Fault, SimulationPart
from ual.types import (
    AltitudeReference,
    FollowPathRequest,
    Frame,
    Geofence,
    GeoWaypoint,
    GoToWaypointGeoRequest,
    GoToWaypointRequest,
    Info,
    LandRequest,
    LeaseInfo,
    MotionRequest,
    Odometry,
    PathHeading,
    Plan,
    RecoverFromManualRequest,
    ReturnToLaunchRequest,
    Route,
    State,
    TakeOffRequest,
    TaskInfo,
    TaskKind,
    TaskRequest,
    Telemetry,
    Waypoints,
)

if TYPE_CHECKING:
    from typing_extensions import Self

T = TypeVar("T")
"""Result of a command: the handle of its task, or an awaitable of that."""
P = TypeVar("P")
"""Result of a dry run: a `Plan`, or an awaitable of that."""


class Task(Protocol):
    """A manoeuvre in progress, or ended."""

    @property
    def id(self) -> str:
        """The identifier by which `Uav.task` finds it."""
        ...

    @property
    def kind(self) -> TaskKind:
        """Kind of manoeuvre."""
        ...

    def info(self) -> TaskInfo:
        """Returns how it stands now."""
        ...

    def done(self) -> bool:
        """Returns True once it has ended, however."""
        ...

    def wait(self, timeout_s: float | None = None) -> TaskInfo:
        """Blocks until it has ended, and returns how.

        Raises:
            UalTimeoutError: It has not ended after `timeout_s`. It goes on.
            UalError: The error that it was aborted by or failed with.

        """
        ...

    def cancel(self) -> None:
        """Ends it: the UAV stops and holds its position. Does nothing if it has ended.

        Raises:
            WrongStateError: It is a take-off or a landing, which only the safety pilot can abort, where there is one.

        """
        ...

    def pause(self) -> None:
        """Brakes on its way and holds there, until `resume`. Does nothing if it is paused already.

        Raises:
            WrongStateError: It has ended, or it cannot be paused (a take-off, a landing, a goal that moves).

        """
        ...

    def resume(self) -> None:
        """Goes on along the rest of its way.

        Raises:
            WrongStateError: It has ended, or it is not paused.

        """
        ...

    def watch(self, rate_hz: float = 10.0) -> Iterator[TaskInfo]:
        """Yields how it stands, `rate_hz` times a second (at most 50; 0: 10), until it has ended. The last value says
        how it ended.
        """
        ...


class Subscription(Protocol):
    """A running subscription. It ends by `close`, or at the end of its ``with`` block."""

    def close(self) -> None:
        """Ends it. No callback begins after this returns, unless a callback itself called it."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *exc: object) -> None: ...


class Simulation(Protocol):
    """The world around a simulated UAV. The manual is ``ual/v1/simulation.proto``.

    A simulation may offer any of its parts. A member of another part raises `NotSupportedError`, whose metadata `part`
    names it; so does whatever a class that inherits from this one leaves out.
    """

    def parts(self) -> frozenset[SimulationPart]:
        """Returns the parts that this simulation offers."""
        ...

    def pilot_arm(self) -> None:
        """Arms, as the safety pilot does. Returns when the UAV is armed."""
        raise _unsupported(self, SimulationPart.PILOT)

    def pilot_disarm(self) -> None:
        """Disarms, as the safety pilot does. Returns when the UAV is disarmed."""
        raise _unsupported(self, SimulationPart.PILOT)

    def pilot_take_over(self) -> None:
        """Switches to a mode in which the safety pilot flies. Tasks and references end."""
        raise _unsupported(self, SimulationPart.PILOT)

    def pilot_move_sticks(self, *, forward: float = 0.0, left: float = 0.0, up: float = 0.0, turn: float = 0.0) -> None:
        """Moves the sticks, each from -1 to 1, and leaves them there. `turn` is counter-clockwise seen from above."""
        raise _unsupported(self, SimulationPart.PILOT)

    def pilot_give_back(self) -> None:
        """Switches back to the mode in which the autopilot takes references from UAL."""
        raise _unsupported(self, SimulationPart.PILOT)

    def begin_fault(self, fault: Fault, duration_s: float = 0.0) -> str:
        """Begins a fault, for `duration_s` of the simulation's time (0: until it is ended). Returns its identifier."""
        raise _unsupported(self, SimulationPart.FAULTS)

    def end_fault(self, fault_id: str = "") -> None:
        """Ends a fault, or all faults where no identifier is given."""
        raise _unsupported(self, SimulationPart.FAULTS)

    def faults(self) -> dict[str, Fault]:
        """Returns the faults that are active, by their identifiers."""
        raise _unsupported(self, SimulationPart.FAULTS)

    def set_speed_factor(self, speed_factor: float) -> None:
        """Sets how fast simulated time passes: 1 as real time, 0 only by `step`."""
        raise _unsupported(self, SimulationPart.TIME)

    def step(self, duration_s: float) -> None:
        """Lets `duration_s` of simulated time pass. Returns when it has passed. Needs the speed factor 0."""
        raise _unsupported(self, SimulationPart.TIME)

    def set_noise(self, *, position_m: float, velocity_m_s: float) -> None:
        """Sets the noise of the estimate, as standard deviations in metres and metres a second."""
        raise _unsupported(self, SimulationPart.NOISE)

    def set_wind(self, velocity_m_s: Vector3) -> None:
        """Sets the wind: the velocity of the air, east, north and up, in metres a second."""
        raise _unsupported(self, SimulationPart.WIND)

    def place_on_ground(self, position: Vector3, yaw_rad: float = 0.0) -> None:
        """Puts the UAV on the ground at a place, disarmed and at rest. A flight ends.

        Args:
            position: Metres east, north and up of the autopilot's local origin, where ``<ns>/odom`` is before any
                `Uav.set_home`. Where the simulation has a ground of its own, that decides the height.
            yaw_rad: The heading, counter-clockwise from east.

        """
        raise _unsupported(self, SimulationPart.PLACE)


def _unsupported(simulation: Simulation, part: SimulationPart) -> NotSupportedError:
    available = ", ".join(sorted(each.name.lower() for each in simulation.parts())) or "nothing of its own"
    what = part.name.lower()
    return NotSupportedError(f"this simulation does not offer the part {what} (it offers: {available})", {"part": what})


class Parameters(Protocol):
    """The parameters of the autopilot, by its own names and in its own units. See ``docs/how-to/parameters.md``.

    Raises:
        NotSupportedError: UAL reads and writes none of this autopilot.

    """

    def get(self, name: str) -> Parameter:
        """Returns a parameter, read from the autopilot now.

        Raises:
            InvalidArgumentError: It has none of this name.
            LinkLostError: Nothing is received from it.
            UalTimeoutError: It has not answered. Not every autopilot says that it has none of a name.

        """
        ...

    def get_all(self) -> list[Parameter]:
        """Returns all parameters, read from the autopilot now. That may take minutes over a slow link.

        Raises:
            LinkLostError: Nothing is received from it.
            UalTimeoutError: Some have not come; the metadata `missing` says how many.

        """
        ...

    def set(self, name: str, value: float, *, force: bool = False) -> Parameter:
        """Writes a parameter, and returns it as it was read back.

        Args:
            name: The autopilot's own name.
            value: In the autopilot's own unit. A whole number where the parameter is one.
            force: Write it also while the UAV is armed, or out of the range that the autopilot tells. Armed, those on
                which a flight relies are refused all the same.

        Raises:
            WrongStateError: The UAV is armed, or that is not known.
            InvalidArgumentError: There is none of this name, or the value does not fit its type or its range.
            RejectedByAutopilotError: The autopilot has kept another value, which the metadata `kept` has.
            LeaseHeldError: Another program holds the lease.
            LinkLostError: Nothing is received from it.
            UalTimeoutError: It has not answered: it is not known whether it was written.

        """
        ...


class Logs(Protocol):
    """The logs that the autopilot has written. They are only read. The manual is ``docs/how-to/logs.md``.

    Raises:
        NotSupportedError: UAL reads none of this autopilot.

    """

    def get_all(self) -> list[Log]:
        """Returns all logs, the oldest first. Those that the autopilot has not described come last (`Log.is_missing`).

        Raises:
            RejectedByAutopilotError: It gives none now, in its own words.
            LinkLostError: Nothing is received from it.
            UalTimeoutError: It has not answered.

        """
        ...

    def download(self, log_id: str, offset: int = 0) -> Iterator[LogChunk]:
        """Yields the pieces of a log, in order. `ual.logs.fetch` writes them into a file, and goes on where it broke.

        Args:
            log_id: As listed by `get_all`.
            offset: Where to begin, in bytes.

        Raises:
            InvalidArgumentError: There is no such log, or it ends before the offset.
            ResourceExhaustedError: Another download is in progress.
            RejectedByAutopilotError: The autopilot refuses it, or the log has become shorter.
            LinkLostError: Nothing is received from it.
            UalTimeoutError: It has not answered.

        """
        ...


class Corrections(Protocol):
    """Corrections for the satellite receiver of the UAV (RTK). The manual is ``docs/how-to/corrections.md``.

    Raises:
        NotSupportedError: They cannot be passed on to this autopilot.

    """

    def stream(self, rtcm: Iterable[bytes], sender: str = "") -> CorrectionsStatus:
        """Passes on a stream of RTCM 3, cut anywhere, until it ends. Needs no lease. Returns what has become of it.

        Args:
            rtcm: The bytes of a base station, as they come. Whole messages with a right checksum are passed on.
            sender: What sends, human-readable, such as the name of the caster. It is in the error that others get.

        Raises:
            ResourceExhaustedError: Another program sends; the metadata `held_by` names it; or it is too much.
            PermissionDeniedError: The daemon only watches.

        """
        ...

    def status(self) -> CorrectionsStatus:
        """Returns what has been sent and dropped since the daemon began, and the sender."""
        ...


class Fence(Protocol):
    """The fence and the rally points that the autopilot keeps, and applies by itself. See ``docs/how-to/fence.md``.

    UAL's own geofence is `Uav.geofence`.

    Raises:
        NotSupportedError: UAL reads and uploads none of this autopilot.

    """

    def get(self) -> KeptFence:
        """Returns what the autopilot keeps, read from it now.

        Raises:
            LinkLostError: Nothing is received from it.
            RejectedByAutopilotError: It refuses, or what it has is no fence.
            UalTimeoutError: It has not answered.

        """
        ...

    def upload(
        self, plan: FencePlan | None = None, *, replace: bool = False, enable: bool = True, force: bool = False
    ) -> KeptFence:
        """Uploads a fence, reads it back, and has the autopilot apply it. Returns what was read back.

        Args:
            plan: The zones and the rally points. None: the polygon of UAL's own geofence.
            replace: Also where the autopilot has another fence, or other rally points.
            enable: Have the autopilot apply its zones; False leaves it as it is.
            force: Upload it also while the UAV is armed.

        Raises:
            WrongStateError: The UAV is armed, or that is not known; or the autopilot has another fence.
            InvalidArgumentError: A zone is none that an autopilot can have.
            GeofenceError: The UAV is not where the fence lets it be.
            RejectedByAutopilotError: It refuses an item, or keeps another one.
            LeaseHeldError: Another program holds the lease.
            LinkLostError: Nothing is received from it.
            UalTimeoutError: It has not answered: it is not known what it has now.

        """
        ...

    def clear(self, *, with_rally_points: bool = False, force: bool = False) -> KeptFence:
        """Removes all zones of the autopilot's fence, and returns what it then keeps.

        Args:
            with_rally_points: Remove these, too.
            force: Remove them also while the UAV is armed.

        Raises:
            WrongStateError: The UAV is armed, or that is not known.
            LeaseHeldError: Another program holds the lease.
            LinkLostError: Nothing is received from it.
            UalTimeoutError: It has not answered: it is not known what it has now.

        """
        ...

    def enable(self) -> KeptFence:
        """Has the autopilot apply its zones. Returns what it keeps.

        Raises:
            WrongStateError: The UAV is armed, or that is not known. Or an upload of zones or rally points was cut off.
            LeaseHeldError: Another program holds the lease.
            RejectedByAutopilotError: It keeps another value of a parameter.
            LinkLostError: Nothing is received from it.
            UalTimeoutError: It has not answered.

        """
        ...

    def disable(self) -> KeptFence:
        """Has the autopilot no longer apply its zones. Returns what it keeps, as `enable`.

        Raises:
            WrongStateError: The UAV is armed, or that is not known.
            LeaseHeldError: Another program holds the lease.
            RejectedByAutopilotError: It keeps another value of a parameter.
            LinkLostError: Nothing is received from it.
            UalTimeoutError: It has not answered.

        """
        ...


class Camera(Protocol):
    """One camera of a UAV. The manual is ``docs/how-to/cameras.md``.

    Raises:
        InvalidArgumentError: There is no camera of this number, or a value cannot be meant.
        NotSupportedError: It cannot do that.
        LinkLostError: Nothing is received from it.
        RejectedByAutopilotError: It refuses, in its own words.
        UalTimeoutError: It does not answer. It is not known whether it did what it was asked.

    """

    def status(self) -> CameraStatus:
        """Returns what it does now."""
        ...

    def take_photo(self) -> Photo:
        """Takes a picture, and returns once the camera has reported that it was taken."""
        ...

    def start_photos(self, *, interval_s: float | None = None, distance_m: float | None = None, count: int = 0) -> None:
        """Begins to take pictures by time or by distance. Replaces what was begun before.

        Args:
            interval_s: The time between two pictures.
            distance_m: How far the UAV has flown from the place of the last picture, when the next one is taken.
            count: By time: after so many pictures it ends. 0: it goes on until `stop_photos`.

        """
        ...

    def stop_photos(self) -> None:
        """Ends what `start_photos` has begun. Does nothing if nothing was."""
        ...

    def start_video(self) -> None:
        """Begins to record a video in the camera."""
        ...

    def stop_video(self) -> None:
        """Ends the video."""
        ...

    def set_mode(self, mode: CameraMode) -> None:
        """Sets its mode."""
        ...

    def set_zoom(self, percent: float) -> None:
        """Zooms, from 0 (wide) to 100."""
        ...

    def set_focus(self, percent: float | None = None) -> None:
        """Focuses, from 0 (near) to 100 (far). None: the camera focuses by itself, once."""
        ...

    def photos(self, first: int = 0) -> list[Photo]:
        """Returns the pictures taken since the daemon was started, from a number on: the last 10,000 at most."""
        ...

    def streams(self) -> list[VideoStream]:
        """Returns where its videos can be watched, by a player of video streams."""
        ...

    def image(self, photo: int | None = None, kind: ImageKind = ImageKind.COLOUR, *, max_age_s: float = 0.0) -> Image:
        """Returns a picture as bytes, with its stamp and its poses.

        Args:
            photo: The number of a picture that was taken. None: what the camera sees now.
            kind: What its pixels mean: one of `CameraInfo.image_kinds`.
            max_age_s: Of what it sees now: a picture that was ordered no longer ago will do, so that several programs
                share one. 0: a new one.

        """
        ...


class Cameras(Protocol):
    """The cameras of a UAV, by their numbers: ``uav.cameras[0]`` is the first that was found.

    Raises:
        NotSupportedError: The backend has no cameras.

    """

    def get_all(self) -> list[CameraInfo]:
        """Returns all cameras that were found, including those from which nothing is received any more."""
        ...

    def __getitem__(self, number: int) -> Camera:
        """Returns the camera of a number. Asks nothing: whether there is one shows when it is used."""
        ...

    def __iter__(self) -> Iterator[Camera]:
        """Yields each camera that was found."""
        ...


class Gripper(Protocol):
    """Payload devices of a UAV that hold, drop and switch, as its daemon is configured. See ``docs/how-to/gripper.md``.

    A name that is left out is the only one that there is. An order that may let a load go is sent once only; one that
    holds it is sent again until it is acknowledged.

    Raises:
        InvalidArgumentError: The configuration has no such name, or a value is out of its bounds.
        NotSupportedError: The backend, or the autopilot, cannot do that.
        WrongStateError: An order of the same device is in progress.
        TaskAbortedError: Another order has replaced it.
        LeaseHeldError: Another program holds the lease.
        RejectedByAutopilotError: It refuses, in its own words.
        LinkLostError: Nothing is received from it.
        UalTimeoutError: It is not known whether it was obeyed: look before you order it again.
    """

    def get_all(self) -> Equipment:
        """Returns all that is configured, with what is known of each now."""
        ...

    def grip(self, gripper: str = "") -> None:
        """Closes a gripper. Returns once that is acknowledged, which may be before it is closed."""
        ...

    def release(self, gripper: str = "") -> None:
        """Opens a gripper, as `grip`."""
        ...

    def order_winch(
        self,
        action: WinchAction,
        *,
        winch: str = "",
        length_m: float | None = None,
        rate_m_s: float | None = None,
    ) -> None:
        """Has a winch do something. Returns once that is acknowledged, which is before it is done.

        Args:
            action: What it is to do.
            winch: Its name.
            length_m: For LENGTH: how much line it lets out; negative takes in.
            rate_m_s: For RATE: how fast it lets out; negative takes in. For LENGTH: how fast, positive, where the winch
                takes that.

        """
        ...

    def set_servo(self, position: str = "", *, servo: str = "", pwm_us: int | None = None) -> None:
        """Moves a servo. Returns once that is acknowledged, which is before it is there.

        Args:
            position: The name of one of its positions.
            servo: Its name.
            pwm_us: A pulse width within its bounds, instead of a position.

        """
        ...

    def set_relay(self, state: str, *, relay: str = "") -> None:
        """Switches a relay to the state of a name, such as "on"."""
        ...


class Parachute(Protocol):
    """The parachute that it carries. See ``ual/v1/parachute.proto``.

    It is a part of an ArduPilot, or a component of the vehicle with any autopilot.

    Raises:
        NotSupportedError: There is no parachute.
        WrongStateError: Another order is in progress.
        TaskAbortedError: A release has replaced it.
        LeaseHeldError: Another program holds the lease.
        RejectedByAutopilotError: It refuses, in its own words.
        LinkLostError: Nothing is received from it.
        UalTimeoutError: It is not known whether it was obeyed.
    """

    def ordered(self) -> str:
        """Returns the order that was acknowledged last, such as "enable".

        It is empty where there was none since the daemon began.
        """
        ...

    def enable(self) -> None:
        """Lets it be released, also by the autopilot itself. Returns once that is acknowledged."""
        ...

    def disable(self) -> None:
        """Keeps it from being released. Returns once that is acknowledged."""
        ...

    def release(self) -> None:
        """Releases it: the UAV falls below it.

        Replaces another order. Returns once that is acknowledged, and an ArduPilot reports that it has released it.
        It is refused with the ArduPilot's text where it has not, as below its least height. A `UalTimeoutError` says
        that nothing was reported, as where it is disabled. An ArduPilot stops the motors; beside another autopilot that
        is the component's to do.
        """
        ...


class Gimbal(Protocol):
    """One gimbal of a UAV. The manual is ``docs/how-to/gimbals.md``.

    Each order replaces the one before. A gimbal that no program on the link controls is taken with the first order.
    Angles follow REP 103: a positive pitch looks down, a positive yaw is to the left.

    Raises:
        InvalidArgumentError: There is no gimbal of this number, or an angle is beyond a limit of it, which is named.
        NotSupportedError: It cannot do that.
        WrongStateError: Another program on the link has the control of it.
        LinkLostError: Nothing is received from it.
        RejectedByAutopilotError: It refuses, in its own words.
        UalTimeoutError: It does not answer. It is not known whether it did what it was ordered.

    """

    def status(self) -> GimbalStatus:
        """Returns where it looks, and what it does."""
        ...

    def watch(self, rate_hz: float = 10.0) -> Iterator[GimbalStatus]:
        """Yields its status so many times a second, 0.1 to 50."""
        ...

    def set_angles(
        self,
        pitch_rad: float,
        yaw_rad: float = 0.0,
        roll_rad: float = 0.0,
        *,
        reference: GimbalReference = GimbalReference.HORIZON,
        frame_id: str = "",
    ) -> None:
        """Turns to angles, and returns once it has accepted them.

        Args:
            pitch_rad: Positive looks down.
            yaw_rad: Positive is to the left.
            roll_rad: Of gimbals with this axis.
            reference: From what the angles count.
            frame_id: With EARTH: from the x axis of which frame yaw counts, as it lies now. Empty: ``<ns>/odom``.

        """
        ...

    def set_rates(self, pitch_rad_s: float, yaw_rad_s: float = 0.0) -> None:
        """Turns at rates until the next order, or a limit. Zeros hold where it looks."""
        ...

    def point_at(self, point: PointStamped | Vector3) -> None:
        """Looks at a position in any frame, and follows it while the UAV or the frame moves, until the next order.

        At what it cannot turn to, it looks as near as its limits let it.

        Raises:
            UnknownFrameError: There is no such frame.
            WrongStateError: It is not known where the frame, or the UAV, is.

        """
        ...

    def move_to_neutral(self) -> None:
        """Turns to its neutral angles."""
        ...

    def retract(self) -> None:
        """Retracts it, as for a landing."""
        ...

    def take_control(self) -> None:
        """Takes the control of it, also from another program on the link."""
        ...

    def release_control(self) -> None:
        """Gives the control up, and ends what was ordered. Does nothing where it is not ours."""
        ...


class Gimbals(Protocol):
    """The gimbals of a UAV, by their numbers: ``uav.gimbals[0]`` is the first that was found.

    Raises:
        NotSupportedError: The backend has no gimbals.

    """

    def get_all(self) -> list[GimbalInfo]:
        """Returns all gimbals that were found, including those from which nothing is received any more."""
        ...

    def __getitem__(self, number: int) -> Gimbal:
        """Returns the gimbal of a number. Asks nothing: whether there is one shows when it is used."""
        ...

    def __iter__(self) -> Iterator[Gimbal]:
        """Yields each gimbal that was found."""
        ...


class Mission(Protocol):
    """The mission that the autopilot flies by itself. The manual is ``docs/how-to/missions.md``.

    It goes on where the link or the daemon is lost. `ual.missions` has the items, and reads them from files.

    Raises:
        NotSupportedError: UAL brings no missions to this autopilot.

    """

    def plan(self, items: Sequence[Item]) -> MissionPlan:
        """Makes a dry run: nothing is sent to the autopilot.

        Raises:
            InvalidArgumentError: The autopilot would ignore an item, or read it otherwise. The metadata `item` has
                its number.
            GeofenceError: It leads outside the fence, below the floor, or above the ceiling.
            WrongStateError: It is not known where the UAV is.

        """
        ...

    def upload(self, items: Sequence[Item]) -> StoredMission:
        """Checks a mission, uploads it, and returns it as it was read back.

        Raises:
            InvalidArgumentError: As `plan`.
            GeofenceError: As `plan`.
            WrongStateError: The autopilot flies a mission now.
            RejectedByAutopilotError: It keeps another one.
            LeaseHeldError: Another program holds the lease.
            LinkLostError: Nothing is received from it.
            UalTimeoutError: It has not answered: download what it has now.

        """
        ...

    def download(self) -> StoredMission:
        """Returns the mission that the autopilot has, read now, whichever program uploaded it.

        Raises:
            LinkLostError: Nothing is received from it.
            UalTimeoutError: It has not answered.

        """
        ...

    def clear(self) -> None:
        """Removes the mission from the autopilot.

        Raises:
            WrongStateError: The autopilot flies a mission now.
            RejectedByAutopilotError: It keeps it.
            LeaseHeldError: Another program holds the lease.
            LinkLostError: Nothing is received from it.
            UalTimeoutError: It has not answered: download what it has now.

        """
        ...

    def start(self, first_item: int = 1, on_link_loss: LinkLossAction | None = None) -> TaskInfo:
        """Flies the mission that the autopilot has. It is read, and checked as by `plan`, before.

        Returns the task once it has begun: `Uav.task` with its `id` waits for it, watches and cancels it.

        Args:
            first_item: The item to begin with, counted from 1.
            on_link_loss: What the autopilot has to do by itself once its ground station is lost. Its parameters are
                read, and never written. None: whatever they say; the task's description tells what.

        Raises:
            WrongStateError: The state is neither FLYING_AUTO nor LANDED_ARMED, the mission cannot begin there, or the
                parameters say something else than `on_link_loss`. Or an upload of the mission or of rally points was
                cut off, and neither has one ended well since, nor was it cleared.
            InvalidArgumentError: It has an item that UAL does not know; the metadata `item` names it.
            GeofenceError: As `plan`.
            LeaseHeldError: Another program holds the lease.
            LinkLostError: Nothing is received from the autopilot.
            UalTimeoutError: It has not answered.

        """
        ...

    def pause(self) -> None:
        """Holds on the way, by the autopilot's own hold.

        Raises:
            WrongStateError: No mission of UAL is flown, or it cannot be paused.

        """
        ...

    def resume(self) -> None:
        """Goes on after `pause`.

        Raises:
            WrongStateError: It is not paused.

        """
        ...

    def jump_to(self, item: int) -> None:
        """Flies on to another item, counted from 1. Returns once the autopilot says that it is the current one.

        Raises:
            WrongStateError: No mission of UAL is flown, it is paused, or there is no such item.
            InvalidArgumentError: The item does not fly.
            UalTimeoutError: The autopilot has not said so.

        """
        ...

    def progress(self) -> MissionProgress:
        """Returns the progress of the autopilot's mission, whichever program started it."""
        ...

    def watch(self) -> Iterator[MissionProgress]:
        """Yields how far the autopilot is with its mission: now, and on each change. It has no end of its own."""
        ...


class DryRun(Generic[P]):
    """The members of `Uav` that move it, with the same arguments, as questions: nothing moves, begins, or is sent.

    Each returns what the motion would be, or raises what the member of `Uav` would raise at once.

    Example:
        >>> uav.dry_run.go_to_waypoint(ual.Pose.at(10.0, 0.0, 3.0)).duration_s
        7.2

    """

    def __init__(self, plan: Callable[[MotionRequest], P]) -> None:
        self._plan = plan

    def take_off(self, height_m: float, *, force: bool = False) -> P:
        """Returns the plan of `Uav.take_off`."""
        return self._plan(TakeOffRequest(height_m, force))

    def land(self) -> P:
        """Returns the plan of `Uav.land`."""
        return self._plan(LandRequest())

    def go_to_waypoint(self, waypoint: PoseStamped | Pose, *, max_speed_m_s: float | None = None) -> P:
        """Returns the plan of `Uav.go_to_waypoint`."""
        return self._plan(GoToWaypointRequest(stamped_pose(waypoint, "waypoint"), max_speed_m_s))

    def go_to_waypoint_geo(
        self,
        latitude_deg: float,
        longitude_deg: float,
        altitude_m: float,
        altitude_reference: AltitudeReference = AltitudeReference.HOME,
        *,
        yaw_rad: float | None = None,
        max_speed_m_s: float | None = None,
    ) -> P:
        """Returns the plan of `Uav.go_to_waypoint_geo`."""
        waypoint = GeoWaypoint(latitude_deg, longitude_deg, altitude_m, altitude_reference, yaw_rad)
        return self._plan(GoToWaypointGeoRequest(waypoint, max_speed_m_s))

    def follow_path(
        self,
        waypoints: Waypoints,
        *,
        corner_radius_m: float = 0.0,
        max_speed_m_s: float | None = None,
        leg_speeds_m_s: Sequence[float] = (),
        heading: PathHeading = PathHeading.WAYPOINTS,
        point_of_interest: PointStamped | Vector3 | None = None,
        holds_s: Sequence[float] = (),
    ) -> P:
        """Returns the plan of `Uav.follow_path`."""
        return self._plan(
            _path_request(
                waypoints, corner_radius_m, max_speed_m_s, leg_speeds_m_s, heading, point_of_interest, holds_s
            )
        )

    def return_to_launch(self, height_m: float | None = None) -> P:
        """Returns the plan of `Uav.return_to_launch`, up to the landing."""
        return self._plan(ReturnToLaunchRequest(height_m))

    def set_pose(self, pose: PoseStamped | Pose) -> P:
        """Returns the plan of `Uav.set_pose`, which says only that it would be taken."""
        return self._plan(stamped_pose(pose))

    def set_velocity(self, velocity: TwistStamped | Twist) -> P:
        """Returns the plan of `Uav.set_velocity`, which says only that it would be taken."""
        return self._plan(stamped_twist(velocity))

    def recover_from_manual(self, *, force: bool = False) -> P:
        """Returns the plan of `Uav.recover_from_manual`, which says only that it would begin."""
        return self._plan(RecoverFromManualRequest(force))


class TaskCommands(ABC, Generic[T]):
    """The commands that are tasks: they take time, can be watched, and end.

    They block until the task has ended, or return its handle at once with ``blocking=False``. The asyncio client has
    the same members as coroutines. A new flying command replaces the task that runs, which ends with
    `TaskAbortedError`; a take-off or landing cannot be replaced. When the safety pilot takes over, a task ends at once.
    """

    @abstractmethod
    def _begin(self, request: TaskRequest, blocking: bool, timeout_s: float | None) -> T:
        """Begins a task, and returns its handle: at once, or when it has ended."""

    def take_off(
        self, height_m: float, *, force: bool = False, blocking: bool = True, timeout_s: float | None = None
    ) -> T:
        """Climbs straight up. Allowed in LANDED_ARMED; ends in FLYING_AUTO.

        After others have flown the UAV, it is refused until the UAV was disarmed once, or `Uav.recover_from_manual` was
        called on the ground.

        Args:
            height_m: Metres above the ground that the UAV stands on, more than 0. It is reached within 5 % (at least
                0.1 m) when the task ends.
            force: Whether to take off although a failsafe of the autopilot is active (``Telemetry.health.failsafe``).
            blocking: Whether to wait for the end.
            timeout_s: How long to wait, in seconds. The take-off goes on when it passes: only the safety pilot,
                where there is one, can abort it.

        Raises:
            WrongStateError: The UAV is not armed on the ground, others have flown it, or a failsafe is active.
            FrameLostError: It is not known any more where the geofence is.
            InvalidArgumentError: The height is not a positive number.
            GeofenceError: The height lies outside the geofence.
            RejectedByAutopilotError: The autopilot refused; its own words are in the message.
            TaskAbortedError: The safety pilot took the UAV.
            UalTimeoutError: The height was not reached in time.

        Example:
            >>> uav.take_off(3.0)
            <Task take_off-1f3a77c0 TAKE_OFF SUCCEEDED>

        """
        return self._begin(TakeOffRequest(height_m, force), blocking, timeout_s)

    def land(self, *, blocking: bool = True, timeout_s: float | None = None) -> T:
        """Lands where the UAV is. Allowed in FLYING_AUTO; ends when the autopilot reports the ground.

        Also allowed in FLYING_MANUAL where the autopilot flies by itself (its hold, a failsafe's return), never while
        the safety pilot flies.

        Args:
            blocking: Whether to wait for the end.
            timeout_s: How long to wait, in seconds. The landing goes on when it passes.

        Raises:
            WrongStateError: The UAV does not fly by references of UAL.
            RejectedByAutopilotError: The autopilot refused.
            TaskAbortedError: The safety pilot took the UAV.

        Example:
            >>> task = uav.land(blocking=False)
            >>> task.wait()

        """
        return self._begin(LandRequest(), blocking, timeout_s)

    def go_to_waypoint(
        self,
        waypoint: PoseStamped | Pose,
        *,
        max_speed_m_s: float | None = None,
        blocking: bool = True,
        timeout_s: float | None = None,
    ) -> T:
        """Flies straight to a pose in any known frame. Allowed in FLYING_AUTO.

        Ends when position and heading are within tolerance. A goal in a frame that moves is followed, and the task ends
        when the UAV goes with it.

        Args:
            waypoint: Where to go: metres, z up. A bare `Pose` is in ``<ns>/odom``. A quaternion of all zeros keeps the
                heading.
            max_speed_m_s: The highest speed in any direction, 0.01 m/s or more. None: only the limits of the UAV.
            blocking: Whether to wait for the end.
            timeout_s: How long to wait, in seconds. The task is cancelled when it passes, and the UAV holds.

        Raises:
            WrongStateError: The UAV does not fly by references of UAL.
            FrameLostError: It is not known any more where the frame is (an autopilot that rebooted indoors).
            InvalidArgumentError: A value is not finite, or out of range; the field is named.
            UnknownFrameError: There is no such frame; the known ones are listed.
            GeofenceError: The goal or the way there lies outside the geofence.
            TaskAbortedError: It was replaced, cancelled, or the safety pilot took the UAV; the message says which.

        Example:
            >>> uav.go_to_waypoint(ual.Pose.at(4.0, 2.0, 3.0, yaw_rad=1.57), max_speed_m_s=2.0)

        """
        return self._begin(GoToWaypointRequest(stamped_pose(waypoint, "waypoint"), max_speed_m_s), blocking, timeout_s)

    def go_to_waypoint_geo(
        self,
        latitude_deg: float,
        longitude_deg: float,
        altitude_m: float,
        altitude_reference: AltitudeReference = AltitudeReference.HOME,
        *,
        yaw_rad: float | None = None,
        max_speed_m_s: float | None = None,
        blocking: bool = True,
        timeout_s: float | None = None,
    ) -> T:
        """Flies straight to a position on Earth (WGS 84). Allowed in FLYING_AUTO.

        Args:
            latitude_deg: Degrees, -90 to 90.
            longitude_deg: Degrees, -180 to 180.
            altitude_m: Metres above the reference.
            altitude_reference: Home, mean sea level, or the ellipsoid.
            yaw_rad: The heading at the goal, counter-clockwise from east. None keeps the heading.
            max_speed_m_s: As in `go_to_waypoint`.
            blocking: Whether to wait for the end.
            timeout_s: As in `go_to_waypoint`.

        Raises:
            WrongStateError: Wrong state, or the autopilot has not said where its home or its local frame is on Earth.
            InvalidArgumentError: A value is out of its range.
            NotSupportedError: The autopilot has no position on Earth, or does not say how the ellipsoid lies.
            GeofenceError: The goal or the way there lies outside the geofence.
            TaskAbortedError: As in `go_to_waypoint`.

        Example:
            >>> uav.go_to_waypoint_geo(37.4122, -5.9984, 20.0)

        """
        waypoint = GeoWaypoint(latitude_deg, longitude_deg, altitude_m, altitude_reference, yaw_rad)
        return self._begin(GoToWaypointGeoRequest(waypoint, max_speed_m_s), blocking, timeout_s)

    def follow_path(
        self,
        waypoints: Waypoints,
        *,
        corner_radius_m: float = 0.0,
        max_speed_m_s: float | None = None,
        leg_speeds_m_s: Sequence[float] = (),
        heading: PathHeading = PathHeading.WAYPOINTS,
        point_of_interest: PointStamped | Vector3 | None = None,
        holds_s: Sequence[float] = (),
        blocking: bool = True,
        timeout_s: float | None = None,
    ) -> T:
        """Flies through waypoints. Allowed in FLYING_AUTO; ends at the last one.

        Args:
            waypoints: Poses in any frames, or geographic positions, but not both in one path.
            corner_radius_m: How far the way may leave the straight legs at a corner. 0: stop at each waypoint.
            max_speed_m_s: As in `go_to_waypoint`.
            leg_speeds_m_s: Empty, or the same for each leg, given with the waypoint that it ends at (0: only
                `max_speed_m_s`).
            heading: Where the nose points. Only `PathHeading.WAYPOINTS` uses the orientations of the waypoints.
            point_of_interest: Where the nose points with `PathHeading.POINT_OF_INTEREST`, and only with that.
            holds_s: Empty, or how long to hold at each waypoint, from the arrival there: seconds, 0 (no stop) to 3600.
            blocking: Whether to wait for the end.
            timeout_s: As in `go_to_waypoint`.

        Raises:
            WrongStateError: The UAV does not fly by references of UAL, or flew on while the path was planned.
            FrameLostError: It is not known any more where the frame is (an autopilot that rebooted indoors).
            InvalidArgumentError: There are no waypoints, or a value is out of range; the field is named.
            UnknownFrameError: There is no such frame.
            GeofenceError: The path leaves the geofence.
            TaskAbortedError: As in `go_to_waypoint`.

        Example:
            >>> corners = [ual.Pose.at(x, y, 3.0) for x, y in ((5, 0), (5, 5), (0, 5), (0, 0))]
            >>> uav.follow_path(corners, corner_radius_m=1.0)

        """
        request = _path_request(
            waypoints, corner_radius_m, max_speed_m_s, leg_speeds_m_s, heading, point_of_interest, holds_s
        )
        return self._begin(request, blocking, timeout_s)

    def return_to_launch(
        self, height_m: float | None = None, *, blocking: bool = True, timeout_s: float | None = None
    ) -> T:
        """Climbs to a safe height, flies straight over home, and lands there. Allowed in FLYING_AUTO.

        Also allowed in FLYING_MANUAL where the autopilot flies by itself (its hold), never while the safety pilot flies
        nor in a failsafe; control is taken back first.

        Home is the autopilot's home position; where that is not known, the place where UAL saw it take off. The UAV
        keeps its heading. Where it is over home already, it lands without a climb.

        Args:
            height_m: It flies home at least at this height above the ground of the take-off, and at its present height
                where that is larger. None: the daemon's `rtl_height_m`, but not above the ceiling and the geofence.
            blocking: Whether to wait for the end.
            timeout_s: How long to wait, in seconds. When it passes, the task is cancelled and the UAV holds, unless the
                landing has begun.

        Raises:
            WrongStateError: The UAV does not fly by references of UAL, or no home is known.
            InvalidArgumentError: The height is not a positive number.
            GeofenceError: Home or the way there lies outside the geofence; the message says what to do.
            TaskAbortedError: As in `go_to_waypoint`. Once the landing has begun, only the safety pilot can
                abort it, where there is one.

        Example:
            >>> uav.return_to_launch()

        """
        return self._begin(ReturnToLaunchRequest(height_m), blocking, timeout_s)


class Lease(ABC):
    """The lease of a UAV: while it is held, no other program flies it. It ends at `release`, or with its ``with``.

    It also ends if the program dies or hangs for 2 s, and if a commander takes it. Whenever a lease begins or ends,
    what is in progress is aborted, and the UAV holds its position; only a take-off or a landing goes on.
    """

    @property
    @abstractmethod
    def lost(self) -> UalError | None:
        """Why it has ended by itself; None while it is held, and where it was released.

        Commands raise `LeaseLostError` then, until `release`.
        """

    @abstractmethod
    def release(self) -> None:
        """Ends it: others may fly from now on. Nothing happens if it has ended."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.release()


class Uav(TaskCommands[Task]):
    """One UAV, whatever its autopilot. The manual of states, errors and units is ``ual/v1/ual.proto``."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    # --- What is known ------------------------------------------------------------------------------------------------

    @property
    @abstractmethod
    def ns(self) -> str:
        """The namespace of the UAV, such as ``uav_1``."""

    @abstractmethod
    def close(self) -> None:
        """Ends all that this object began. Later calls raise `UalError`."""

    @abstractmethod
    def info(self) -> Info:
        """Returns the identity of the UAV and its capabilities: backend, autopilot, capabilities, limits.

        Example:
            >>> uav.info().autopilot
            'PX4'

        """

    @abstractmethod
    def telemetry(self) -> Telemetry:
        """Returns the newest sample of everything known. What is not known is None.

        Example:
            >>> uav.telemetry().battery.remaining_percent
            87.0

        """

    def state(self) -> State:
        """Returns the state, estimated from the newest data of the autopilot.

        Example:
            >>> uav.state() is ual.State.FLYING_AUTO
            True

        """
        return views.state(self.telemetry())

    def wait_for(self, *states: State, timeout_s: float | None = None) -> State:
        """Blocks until the UAV is in one of some states, and returns that one. It returns at once if it is already.

        Args:
            states: The states to wait for, at least one.
            timeout_s: How long to wait, in seconds. None: for ever, also while the daemon cannot be reached any more.

        Raises:
            InvalidArgumentError: No state is given, or one is no `State`.
            UalTimeoutError: None of the states came in time.

        Example:
            >>> uav.wait_for(ual.State.LANDED_ARMED, timeout_s=60.0)  # until the safety pilot has armed
            >>> uav.take_off(3.0)
        """
        views.require_states(states)
        limit_s = time_limit(timeout_s)
        reached: SimpleQueue[State] = SimpleQueue()

        def note(sample: Telemetry) -> None:
            if sample.state in states:
                reached.put(sample.state)

        with self.subscribe(note):
            state = self.state()
            if state in states:
                return state
            try:
                return reached.get(timeout=limit_s)
            except Empty:
                raise views.not_reached(states, self.telemetry(), limit_s) from None

    def is_ready(self) -> bool:
        """Returns True when the state is not UNINITIALIZED."""
        return views.is_ready(self.telemetry())

    def is_idle(self) -> bool:
        """Returns True when no task runs."""
        return views.is_idle(self.telemetry())

    def pose(self) -> PoseStamped:
        """Returns the pose of the body, in ``<ns>/odom`` or in the configured `pose_frame_id`.

        Raises:
            WrongStateError: The pose is not known (yet).
            FrameLostError: It is not known any more where the frame is.

        Example:
            >>> uav.pose().pose.position
            Vector3(x=0.0, y=0.0, z=3.0)

        """
        return views.pose(self.telemetry())

    def velocity(self) -> TwistStamped:
        """Returns the velocity in m/s and rad/s, along the axes of the frame of `pose`.

        Raises:
            WrongStateError: The velocity is not known (yet).

        """
        return views.velocity(self.telemetry())

    def odometry(self) -> Odometry:
        """Returns the pose in ``<ns>/odom`` with the velocity along the axes of the body.

        Raises:
            WrongStateError: The odometry is not known (yet).
            FrameLostError: It is not known any more where the frame is.

        """
        return views.odometry(self.telemetry())

    def reference_pose(self) -> PoseStamped | None:
        """Returns where the UAV is commanded to be now; None while no pose is commanded."""
        return views.reference_pose(self.telemetry())

    @abstractmethod
    def subscribe(self, callback: Callable[[Telemetry], None], rate_hz: float = 0.0) -> Subscription:
        """Calls back with new samples, on a thread that is not the caller's.

        A callback that is too slow gets the newest sample, and sees in its `missed_count` how many it lost.

        Args:
            callback: Called with each sample. An exception in it is logged, and the subscription goes on.
            rate_hz: The highest number of samples a second. 0: every update.

        Raises:
            InvalidArgumentError: The rate is no number, or negative.

        Example:
            >>> with uav.subscribe(lambda sample: print(sample.state), rate_hz=2.0):
            ...     uav.take_off(3.0)

        """

    # --- Frames -------------------------------------------------------------------------------------------------------

    @abstractmethod
    def transform(self, target_frame_id: str = "", source_frame_id: str = "") -> Transform:
        """Returns what takes coordinates in the source frame to the target frame.

        Args:
            target_frame_id: Default ``map``.
            source_frame_id: Default ``<ns>/base_link``, the body.

        Raises:
            UnknownFrameError: There is no such frame; the known ones are listed.
            WrongStateError: It is not known yet where one of them is.
            FrameLostError: It is not known any more where the frame is.

        """

    @abstractmethod
    def frames(self) -> list[Frame]:
        """Returns all frames, each with its parent."""

    @abstractmethod
    def geofence(self) -> Geofence:
        """Returns where the UAV may fly now: the geofence, the floor, the ceiling, and the autopilot's own fence.

        Raises:
            WrongStateError: It is not known where they lie.
            FrameLostError: It is not known any more.

        """

    @abstractmethod
    def route(self) -> Route | None:
        """Returns the way of the running task, or to the goal of `set_pose` in a frame that moves.

        None where nothing is flown whose way is known: of a landing, which the autopilot flies, or of a velocity.

        Raises:
            WrongStateError: It is not known where the UAV's local frame lies in ``map``.
            FrameLostError: It is not known any more.
            ResourceExhaustedError: Too many ask at once.

        """

    @abstractmethod
    def add_frame(self, transform: Transform) -> None:
        """Adds a frame, or moves one that was added. A frame may be moved often (50 Hz).

        Args:
            transform: Where the frame `child_frame_id` lies in its parent `frame_id` (empty: ``map``). `stamp_s` is
                when it was there, 0 where that is not known.

        Raises:
            InvalidArgumentError: The name is none, the frame is not the caller's to move, or the transform is none.
            UnknownFrameError: There is no such parent.
            ResourceExhaustedError: There would be too many frames, or too many levels of them.

        Example:
            >>> uav.add_frame(ual.Transform(ual.Vector3(10.0, 0.0, 0.0), child_frame_id="tower"))
            >>> uav.go_to_waypoint(ual.PoseStamped(ual.Pose.at(0.0, 0.0, 5.0), "tower"))

        """

    @abstractmethod
    def remove_frame(self, frame_id: str) -> None:
        """Removes a frame that was added. A UAV that follows a goal in it (a frame that moves) stops.

        Raises:
            UnknownFrameError: There is no such frame.
            InvalidArgumentError: The frame is built in or configured, or other frames lie below it.

        """

    @abstractmethod
    def set_home(self, set_z: bool = False) -> None:
        """Makes the present position the origin of ``<ns>/odom``. Allowed in LANDED_DISARMED and LANDED_ARMED.

        Args:
            set_z: Whether the height becomes 0, too.

        Raises:
            WrongStateError: The UAV is not on the ground.

        """

    # --- Commands -----------------------------------------------------------------------------------------------------

    @abstractmethod
    def arm(self, *, timeout_s: float | None = None) -> None:
        """Arms the motors, and returns when the autopilot says that they are. Allowed in LANDED_DISARMED.

        Raises:
            PermissionDeniedError: Arming a real UAV belongs to its safety pilot (see ``--allow-arming``).
            WrongStateError: The UAV is not disarmed on the ground.
            RejectedByAutopilotError: The autopilot refused; its own words are in the message.
            UalTimeoutError: It was not armed within `timeout_s`.

        """

    @abstractmethod
    def disarm(self, *, timeout_s: float | None = None) -> None:
        """Disarms the motors, and returns when the autopilot says that they are. Allowed in LANDED_ARMED.

        Raises:
            PermissionDeniedError: As in `arm`.
            WrongStateError: The UAV is not armed on the ground.
            RejectedByAutopilotError: The autopilot refused.
            UalTimeoutError: It was not disarmed within `timeout_s`.

        """

    @abstractmethod
    def lease(self, holder: str = "", *, take: bool = False) -> Lease:
        """Makes this object the only one that flies the UAV, until the lease ends.

        A lease is optional: without one, every pilot may fly.

        Args:
            holder: How the program is called where others are refused, at most 64 characters. Empty: its address.
            take: Whether to take the lease from another program, which only a commander may.

        Raises:
            LeaseHeldError: Another program holds it.
            PermissionDeniedError: Only a commander may take it.
            NotSupportedError: The daemon is too old for leases.

        Example:
            >>> with uav.lease("survey"):
            ...     uav.take_off(3.0)
            ...     uav.land()

        """

    @abstractmethod
    def extension(self, name: str) -> Any:  # noqa: ANN401 (its type is the package's)
        """Returns the interface of an extension: what a package has added to the daemon (a gripper, a gimbal).

        Its type is the package's; see the package for its members.

        Args:
            name: The name of the extension.

        Raises:
            NotSupportedError: It is not loaded; or, of the client, its package is not installed here.

        Example:
            >>> uav.extension("arm").move(shoulder_rad=0.5, elbow_rad=-1.0)

        """

    @abstractmethod
    def lease_info(self) -> LeaseInfo | None:
        """Returns the holder of the lease; None where there is no lease."""

    @abstractmethod
    def set_pose(self, pose: PoseStamped | Pose) -> None:
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

    @abstractmethod
    def set_velocity(self, velocity: TwistStamped | Twist) -> None:
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

        Example:
            >>> for _ in range(100):
            ...     uav.set_velocity(ual.Twist(ual.Vector3(x=1.0)))
            ...     time.sleep(0.02)

        """

    @abstractmethod
    def set_external_pose(
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

        Example:
            >>> uav.set_external_pose(ual.PoseStamped(ual.Pose.at(0.3, 1.2, 0.8), "map"), position_std_dev_m=0.005)

        """

    @abstractmethod
    def recover_from_manual(self, *, force: bool = False, timeout_s: float | None = None) -> None:
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

    @abstractmethod
    def abort(self, freeze: bool = False) -> None:
        """Cancels the task or reference, and stops the UAV. Allowed in FLYING_AUTO. Returns at once.

        Args:
            freeze: Whether to hold the present position instead of braking to rest ahead of it.

        Raises:
            WrongStateError: The UAV does not fly by references of UAL, or a take-off or landing runs.

        """

    @abstractmethod
    def pause(self) -> None:
        """Brakes on the way of the running task and holds there. Allowed in FLYING_AUTO. Returns at once.

        The task still runs, but its time limit does not; `TaskInfo.is_paused` is True. Another command, an abort, or
        the safety pilot ends it as usual. Does nothing if the task is paused already.

        Raises:
            WrongStateError: No task runs, or it cannot be paused (a take-off, a landing, a goal that moves).

        Example:
            >>> task = uav.go_to_waypoint(ual.Pose.at(20.0, 0.0, 3.0), blocking=False)
            >>> uav.pause()
            >>> uav.resume()
            >>> task.wait()

        """

    @abstractmethod
    def resume(self) -> None:
        """Goes on with the paused task, along the rest of its way. Allowed in FLYING_AUTO. Returns at once.

        Raises:
            WrongStateError: No task runs, or it is not paused.

        """

    @abstractmethod
    def task(self, task_id: str) -> Task:
        """Returns the handle of a task that runs, or ended lately.

        Raises:
            InvalidArgumentError: There is no such task.

        """

    @property
    @abstractmethod
    def dry_run(self) -> DryRun[Plan]:
        """The motions as questions: what would happen, without anything moving."""

    @property
    @abstractmethod
    def simulation(self) -> Simulation:
        """The world around a simulated UAV.

        Raises:
            NotSupportedError: The UAV is a real one.

        """

    @property
    @abstractmethod
    def parameters(self) -> Parameters:
        """The autopilot's own parameters."""

    @property
    @abstractmethod
    def mission(self) -> Mission:
        """The mission that the autopilot flies by itself."""

    @property
    @abstractmethod
    def cameras(self) -> Cameras:
        """The cameras that it carries."""

    @property
    @abstractmethod
    def gimbals(self) -> Gimbals:
        """The gimbals that it carries."""

    @property
    @abstractmethod
    def corrections(self) -> Corrections:
        """Corrections for its satellite receiver (RTK)."""

    @property
    @abstractmethod
    def fence(self) -> Fence:
        """The fence and the rally points that the autopilot keeps."""

    @property
    @abstractmethod
    def gripper(self) -> Gripper:
        """The grippers, winches, servos and relays that it carries."""

    @property
    @abstractmethod
    def parachute(self) -> Parachute:
        """The parachute that it carries."""

    @property
    @abstractmethod
    def logs(self) -> Logs:
        """The logs that the autopilot has written."""


def _path_request(
    waypoints: Waypoints,
    corner_radius_m: float,
    max_speed_m_s: float | None,
    leg_speeds_m_s: Sequence[float],
    heading: PathHeading,
    point_of_interest: PointStamped | Vector3 | None,
    holds_s: Sequence[float],
) -> FollowPathRequest:
    """The request of a path. Poses and points without a frame are in ``<ns>/odom``."""
    interest = None if point_of_interest is None else stamped_point(point_of_interest, "point_of_interest")
    speeds_m_s = _listed(leg_speeds_m_s, "leg_speeds_m_s", "speeds; pass [1.0, ...]")
    stamped = [
        each if isinstance(each, GeoWaypoint) else stamped_pose(each, f"waypoints[{i}]")
        for i, each in enumerate(_listed(waypoints, "waypoints", "waypoints; pass [ual.Pose.at(x, y, z), ...]"))
    ]
    holds = _listed(holds_s, "holds_s", "times; pass [0.0, ...]")
    return FollowPathRequest(stamped, corner_radius_m, max_speed_m_s, speeds_m_s, heading, interest, holds)


def _listed(values: Iterable[T], field: str, of_what: str) -> list[T]:
    try:
        return list(values)
    except TypeError:
        raise InvalidArgumentError(f"{field}: {values!r:.100} is not a list of {of_what}", {"field": field}) from None
