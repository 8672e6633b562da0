"""The services beside that of the UAV, for asyncio. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import AsyncIterator, Sequence

from ual._service_calls import camera as _camera_calls
from ual._service_calls import corrections as _corrections_calls
from ual._service_calls import fence as _fence_calls
from ual._service_calls import gimbal as _gimbal_calls
from ual._service_calls import gripper as _gripper_calls
from ual._service_calls import logs as _logs_calls
from ual._service_calls import mission as _mission_calls
from ual._service_calls import parachute as _parachute_calls
from ual._service_calls import parameters as _parameters_calls
from ual.aio._connection import Connection
from ual.aio._corrections import CorrectionsBase
from ual.cameras import CameraInfo, CameraMode, CameraStatus, Image, ImageKind, Photo, VideoStream
from ual.corrections import CorrectionsStatus
from ual.fences.values import FencePlan, KeptFence
from ual.geometry import PointStamped, Vector3
from ual.gimbals import GimbalInfo, GimbalReference, GimbalStatus
from ual.gripper import Equipment, WinchAction
from ual.logs.values import Log, LogChunk
from ual.missions.items import Item
from ual.missions.plan import LinkLossAction, MissionPlan, MissionProgress, StoredMission
from ual.parameters.values import Parameter
from ual.types import TaskInfo


class Camera:
    """`ual.interface.Camera`, over gRPC."""

    def __init__(self, connection: Connection, number: int) -> None:
        self._connection = connection
        self._number = number

    def __repr__(self) -> str:
        return f"<Camera {self._number} of {self._connection.described}>"

    async def status(self) -> CameraStatus:
        """Returns what it does now."""
        return await self._connection.run(_camera_calls.status(self._number))

    async def take_photo(self) -> Photo:
        """Takes a picture, and returns once the camera has reported that it was taken."""
        return await self._connection.run(_camera_calls.take_photo(self._number))

    async def start_photos(
        self, *, interval_s: float | None = None, distance_m: float | None = None, count: int = 0
    ) -> None:
        """Begins to take pictures by time or by distance. Replaces what was begun before.

        Args:
            interval_s: The time between two pictures.
            distance_m: How far the UAV has flown from the place of the last picture, when the next one is taken.
            count: By time: after so many pictures it ends. 0: it goes on until `stop_photos`.

        """
        await self._connection.run(
            _camera_calls.start_photos(self._number, interval_s=interval_s, distance_m=distance_m, count=count)
        )

    async def stop_photos(self) -> None:
        """Ends what `start_photos` has begun. Does nothing if nothing was."""
        await self._connection.run(_camera_calls.stop_photos(self._number))

    async def start_video(self) -> None:
        """Begins to record a video in the camera."""
        await self._connection.run(_camera_calls.start_video(self._number))

    async def stop_video(self) -> None:
        """Ends the video."""
        await self._connection.run(_camera_calls.stop_video(self._number))

    async def set_mode(self, mode: CameraMode) -> None:
        """Sets its mode."""
        await self._connection.run(_camera_calls.set_mode(self._number, mode))

    async def set_zoom(self, percent: float) -> None:
        """Zooms, from 0 (wide) to 100."""
        await self._connection.run(_camera_calls.set_zoom(self._number, percent))

    async def set_focus(self, percent: float | None = None) -> None:
        """Focuses, from 0 (near) to 100 (far). None: the camera focuses by itself, once."""
        await self._connection.run(_camera_calls.set_focus(self._number, percent))

    async def photos(self, first: int = 0) -> list[Photo]:
        """Returns the pictures taken since the daemon was started, from a number on: the last 10,000 at most."""
        return await self._connection.run(_camera_calls.photos(self._number, first))

    async def streams(self) -> list[VideoStream]:
        """Returns where its videos can be watched, by a player of video streams."""
        return await self._connection.run(_camera_calls.streams(self._number))

    async def image(
        self, photo: int | None = None, kind: ImageKind = ImageKind.COLOUR, *, max_age_s: float = 0.0
    ) -> Image:
        """Returns a picture as bytes, with its stamp and its poses.

        Args:
            photo: The number of a picture that was taken. None: what the camera sees now.
            kind: What its pixels mean: one of `CameraInfo.image_kinds`.
            max_age_s: Of what it sees now: a picture that was ordered no longer ago will do, so that several programs
                share one. 0: a new one.

        """
        return await self._connection.run(
            _camera_calls.image(self._number, photo=photo, kind=kind, max_age_s=max_age_s)
        )


class Cameras:
    """`ual.interface.Cameras`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Cameras of {self._connection.described}>"

    def __getitem__(self, number: int) -> Camera:
        """Returns that of a number. Asks nothing: whether there is one shows when it is used."""
        return Camera(self._connection, number)

    async def __aiter__(self) -> AsyncIterator[Camera]:
        """Yields each that was found."""
        for each in await self.get_all():
            yield self[each.number]

    __iter__ = None  # Python would else count numbers without an end

    async def get_all(self) -> list[CameraInfo]:
        """Returns all cameras that were found, including those from which nothing is received any more."""
        return await self._connection.run(_camera_calls.get_all())


class Corrections(CorrectionsBase):
    """`ual.interface.Corrections`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Corrections of {self._connection.described}>"

    async def status(self) -> CorrectionsStatus:
        """Returns what has been sent and dropped since the daemon began, and the sender."""
        return await self._connection.run(_corrections_calls.status())


class Fence:
    """`ual.interface.Fence`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Fence of {self._connection.described}>"

    async def get(self) -> KeptFence:
        """Returns what the autopilot keeps, read from it now.

        Raises:
            LinkLostError: Nothing is received from it.
            RejectedByAutopilotError: It refuses, or what it has is no fence.
            UalTimeoutError: It has not answered.

        """
        return await self._connection.run(_fence_calls.get())

    async def upload(
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
        return await self._connection.run(_fence_calls.upload(plan=plan, replace=replace, enable=enable, force=force))

    async def clear(self, *, with_rally_points: bool = False, force: bool = False) -> KeptFence:
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
        return await self._connection.run(_fence_calls.clear(with_rally_points=with_rally_points, force=force))

    async def enable(self) -> KeptFence:
        """Has the autopilot apply its zones. Returns what it keeps.

        Raises:
            WrongStateError: The UAV is armed, or that is not known. Or an upload of zones or rally points was cut off.
            LeaseHeldError: Another program holds the lease.
            RejectedByAutopilotError: It keeps another value of a parameter.
            LinkLostError: Nothing is received from it.
            UalTimeoutError: It has not answered.

        """
        return await self._connection.run(_fence_calls.enable())

    async def disable(self) -> KeptFence:
        """Has the autopilot no longer apply its zones. Returns what it keeps, as `enable`.

        Raises:
            WrongStateError: The UAV is armed, or that is not known.
            LeaseHeldError: Another program holds the lease.
            RejectedByAutopilotError: It keeps another value of a parameter.
            LinkLostError: Nothing is received from it.
            UalTimeoutError: It has not answered.

        """
        return await self._connection.run(_fence_calls.disable())


class Gimbal:
    """`ual.interface.Gimbal`, over gRPC."""

    def __init__(self, connection: Connection, number: int) -> None:
        self._connection = connection
        self._number = number

    def __repr__(self) -> str:
        return f"<Gimbal {self._number} of {self._connection.described}>"

    async def status(self) -> GimbalStatus:
        """Returns where it looks, and what it does."""
        return await self._connection.run(_gimbal_calls.status(self._number))

    def watch(self, rate_hz: float = 10.0) -> AsyncIterator[GimbalStatus]:
        """Yields its status so many times a second, 0.1 to 50."""
        return self._connection.iterate(_gimbal_calls.watch(self._number, rate_hz))

    async def set_angles(
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
        await self._connection.run(
            _gimbal_calls.set_angles(
                self._number,
                pitch_rad=pitch_rad,
                yaw_rad=yaw_rad,
                roll_rad=roll_rad,
                reference=reference,
                frame_id=frame_id,
            )
        )

    async def set_rates(self, pitch_rad_s: float, yaw_rad_s: float = 0.0) -> None:
        """Turns at rates until the next order, or a limit. Zeros hold where it looks."""
        await self._connection.run(_gimbal_calls.set_rates(self._number, pitch_rad_s=pitch_rad_s, yaw_rad_s=yaw_rad_s))

    async def point_at(self, point: PointStamped | Vector3) -> None:
        """Looks at a position in any frame, and follows it while the UAV or the frame moves, until the next order.

        At what it cannot turn to, it looks as near as its limits let it.

        Raises:
            UnknownFrameError: There is no such frame.
            WrongStateError: It is not known where the frame, or the UAV, is.

        """
        await self._connection.run(_gimbal_calls.point_at(self._number, point))

    async def move_to_neutral(self) -> None:
        """Turns to its neutral angles."""
        await self._connection.run(_gimbal_calls.move_to_neutral(self._number))

    async def retract(self) -> None:
        """Retracts it, as for a landing."""
        await self._connection.run(_gimbal_calls.retract(self._number))

    async def take_control(self) -> None:
        """Takes the control of it, also from another program on the link."""
        await self._connection.run(_gimbal_calls.take_control(self._number))

    async def release_control(self) -> None:
        """Gives the control up, and ends what was ordered. Does nothing where it is not ours."""
        await self._connection.run(_gimbal_calls.release_control(self._number))


class Gimbals:
    """`ual.interface.Gimbals`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Gimbals of {self._connection.described}>"

    def __getitem__(self, number: int) -> Gimbal:
        """Returns that of a number. Asks nothing: whether there is one shows when it is used."""
        return Gimbal(self._connection, number)

    async def __aiter__(self) -> AsyncIterator[Gimbal]:
        """Yields each that was found."""
        for each in await self.get_all():
            yield self[each.number]

    __iter__ = None  # Python would else count numbers without an end

    async def get_all(self) -> list[GimbalInfo]:
        """Returns all gimbals that were found, including those from which nothing is received any more."""
        return await self._connection.run(_gimbal_calls.get_all())


class Gripper:
    """`ual.interface.Gripper`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Gripper of {self._connection.described}>"

    async def get_all(self) -> Equipment:
        """Returns all that is configured, with what is known of each now."""
        return await self._connection.run(_gripper_calls.get_all())

    async def grip(self, gripper: str = "") -> None:
        """Closes a gripper. Returns once that is acknowledged, which may be before it is closed."""
        await self._connection.run(_gripper_calls.grip(gripper))

    async def release(self, gripper: str = "") -> None:
        """Opens a gripper, as `grip`."""
        await self._connection.run(_gripper_calls.release(gripper))

    async def order_winch(
        self, action: WinchAction, *, winch: str = "", length_m: float | None = None, rate_m_s: float | None = None
    ) -> None:
        """Has a winch do something. Returns once that is acknowledged, which is before it is done.

        Args:
            action: What it is to do.
            winch: Its name.
            length_m: For LENGTH: how much line it lets out; negative takes in.
            rate_m_s: For RATE: how fast it lets out; negative takes in. For LENGTH: how fast, positive, where the winch
                takes that.

        """
        await self._connection.run(
            _gripper_calls.order_winch(action=action, winch=winch, length_m=length_m, rate_m_s=rate_m_s)
        )

    async def set_servo(self, position: str = "", *, servo: str = "", pwm_us: int | None = None) -> None:
        """Moves a servo. Returns once that is acknowledged, which is before it is there.

        Args:
            position: The name of one of its positions.
            servo: Its name.
            pwm_us: A pulse width within its bounds, instead of a position.

        """
        await self._connection.run(_gripper_calls.set_servo(position=position, servo=servo, pwm_us=pwm_us))

    async def set_relay(self, state: str, *, relay: str = "") -> None:
        """Switches a relay to the state of a name, such as "on"."""
        await self._connection.run(_gripper_calls.set_relay(state=state, relay=relay))


class Logs:
    """`ual.interface.Logs`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Logs of {self._connection.described}>"

    async def get_all(self) -> list[Log]:
        """Returns all logs, the oldest first. Those that the autopilot has not described come last (`Log.is_missing`).

        Raises:
            RejectedByAutopilotError: It gives none now, in its own words.
            LinkLostError: Nothing is received from it.
            UalTimeoutError: It has not answered.

        """
        return await self._connection.run(_logs_calls.get_all())

    def download(self, log_id: str, offset: int = 0) -> AsyncIterator[LogChunk]:
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
        return self._connection.iterate(_logs_calls.download(log_id=log_id, offset=offset))


class Mission:
    """`ual.interface.Mission`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Mission of {self._connection.described}>"

    async def plan(self, items: Sequence[Item]) -> MissionPlan:
        """Makes a dry run: nothing is sent to the autopilot.

        Raises:
            InvalidArgumentError: The autopilot would ignore an item, or read it otherwise. The metadata `item` has
                its number.
            GeofenceError: It leads outside the fence, below the floor, or above the ceiling.
            WrongStateError: It is not known where the UAV is.

        """
        return await self._connection.run(_mission_calls.plan(items))

    async def upload(self, items: Sequence[Item]) -> StoredMission:
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
        return await self._connection.run(_mission_calls.upload(items))

    async def download(self) -> StoredMission:
        """Returns the mission that the autopilot has, read now, whichever program uploaded it.

        Raises:
            LinkLostError: Nothing is received from it.
            UalTimeoutError: It has not answered.

        """
        return await self._connection.run(_mission_calls.download())

    async def clear(self) -> None:
        """Removes the mission from the autopilot.

        Raises:
            WrongStateError: The autopilot flies a mission now.
            RejectedByAutopilotError: It keeps it.
            LeaseHeldError: Another program holds the lease.
            LinkLostError: Nothing is received from it.
            UalTimeoutError: It has not answered: download what it has now.

        """
        await self._connection.run(_mission_calls.clear())

    async def start(self, first_item: int = 1, on_link_loss: LinkLossAction | None = None) -> TaskInfo:
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
        return await self._connection.run(_mission_calls.start(first_item=first_item, on_link_loss=on_link_loss))

    async def pause(self) -> None:
        """Holds on the way, by the autopilot's own hold.

        Raises:
            WrongStateError: No mission of UAL is flown, or it cannot be paused.

        """
        await self._connection.run(_mission_calls.pause())

    async def resume(self) -> None:
        """Goes on after `pause`.

        Raises:
            WrongStateError: It is not paused.

        """
        await self._connection.run(_mission_calls.resume())

    async def jump_to(self, item: int) -> None:
        """Flies on to another item, counted from 1. Returns once the autopilot says that it is the current one.

        Raises:
            WrongStateError: No mission of UAL is flown, it is paused, or there is no such item.
            InvalidArgumentError: The item does not fly.
            UalTimeoutError: The autopilot has not said so.

        """
        await self._connection.run(_mission_calls.jump_to(item))

    async def progress(self) -> MissionProgress:
        """Returns the progress of the autopilot's mission, whichever program started it."""
        return await self._connection.run(_mission_calls.progress())

    def watch(self) -> AsyncIterator[MissionProgress]:
        """Yields how far the autopilot is with its mission: now, and on each change. It has no end of its own."""
        return self._connection.iterate(_mission_calls.watch())


class Parachute:
    """`ual.interface.Parachute`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Parachute of {self._connection.described}>"

    async def ordered(self) -> str:
        """Returns the order that was acknowledged last, such as "enable".

        It is empty where there was none since the daemon began.

        """
        return await self._connection.run(_parachute_calls.ordered())

    async def enable(self) -> None:
        """Lets it be released, also by the autopilot itself. Returns once that is acknowledged."""
        await self._connection.run(_parachute_calls.enable())

    async def disable(self) -> None:
        """Keeps it from being released. Returns once that is acknowledged."""
        await self._connection.run(_parachute_calls.disable())

    async def release(self) -> None:
        """Releases it: the UAV falls below it.

        Replaces another order. Returns once that is acknowledged, and an ArduPilot reports that it has released it.
        It is refused with the ArduPilot's text where it has not, as below its least height. A `UalTimeoutError` says
        that nothing was reported, as where it is disabled. An ArduPilot stops the motors; beside another autopilot that
        is the component's to do.

        """
        await self._connection.run(_parachute_calls.release())


class Parameters:
    """`ual.interface.Parameters`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Parameters of {self._connection.described}>"

    async def get(self, name: str) -> Parameter:
        """Returns a parameter, read from the autopilot now.

        Raises:
            InvalidArgumentError: It has none of this name.
            LinkLostError: Nothing is received from it.
            UalTimeoutError: It has not answered. Not every autopilot says that it has none of a name.

        """
        return await self._connection.run(_parameters_calls.get(name))

    async def get_all(self) -> list[Parameter]:
        """Returns all parameters, read from the autopilot now. That may take minutes over a slow link.

        Raises:
            LinkLostError: Nothing is received from it.
            UalTimeoutError: Some have not come; the metadata `missing` says how many.

        """
        return await self._connection.run(_parameters_calls.get_all())

    async def set(self, name: str, value: float, *, force: bool = False) -> Parameter:
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
        return await self._connection.run(_parameters_calls.set_(name=name, value=value, force=force))


class Parts:
    """The services of a UAV."""

    def __init__(self, connection: Connection) -> None:
        self.cameras = Cameras(connection)
        self.corrections = Corrections(connection)
        self.fence = Fence(connection)
        self.gimbals = Gimbals(connection)
        self.gripper = Gripper(connection)
        self.logs = Logs(connection)
        self.mission = Mission(connection)
        self.parachute = Parachute(connection)
        self.parameters = Parameters(connection)


class PartMembers:
    """The members of `ual.aio.Uav` that return its services."""

    _parts: Parts

    @property
    def cameras(self) -> Cameras:
        """The cameras that it carries."""
        return self._parts.cameras

    @property
    def corrections(self) -> Corrections:
        """Corrections for its satellite receiver (RTK)."""
        return self._parts.corrections

    @property
    def fence(self) -> Fence:
        """The fence and the rally points that the autopilot keeps."""
        return self._parts.fence

    @property
    def gimbals(self) -> Gimbals:
        """The gimbals that it carries."""
        return self._parts.gimbals

    @property
    def gripper(self) -> Gripper:
        """The grippers, winches, servos and relays that it carries."""
        return self._parts.gripper

    @property
    def logs(self) -> Logs:
        """The logs that the autopilot has written."""
        return self._parts.logs

    @property
    def mission(self) -> Mission:
        """The mission that the autopilot flies by itself."""
        return self._parts.mission

    @property
    def parachute(self) -> Parachute:
        """The parachute that it carries."""
        return self._parts.parachute

    @property
    def parameters(self) -> Parameters:
        """The autopilot's own parameters."""
        return self._parts.parameters
