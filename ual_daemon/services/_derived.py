"""The services of a UAV in this process. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Protocol

from typing_extensions import override

from ual import interface
from ual.cameras import CameraInfo, CameraMode, CameraStatus, Image, ImageKind, Photo, VideoStream
from ual.corrections import CorrectionsStatus
from ual.fences.values import FencePlan, KeptFence
from ual.geometry import PointStamped, Transform, Vector3
from ual.gimbals import GimbalInfo, GimbalReference, GimbalStatus
from ual.gripper import Equipment, WinchAction
from ual.logs.values import Log, LogChunk
from ual.missions.items import Item
from ual.missions.plan import LinkLossAction, MissionPlan, MissionProgress, StoredMission
from ual.parameters.values import Parameter
from ual.types import Frame, Geofence, Info, Route, TaskInfo, Telemetry
from ual_daemon.services.answers import answer, answers
from ual_daemon.services.cameras import VehicleCameras
from ual_daemon.services.corrections import CorrectionsBase, VehicleCorrections
from ual_daemon.services.fence import FenceBase, FencedVehicle, VehicleFence
from ual_daemon.services.gimbals import VehicleGimbals
from ual_daemon.services.gripper import EquippedVehicle, VehicleGripper
from ual_daemon.services.logs import VehicleLogs
from ual_daemon.services.mission import VehicleMission
from ual_daemon.services.parachute import VehicleParachute
from ual_daemon.services.parameters import VehicleParameters
from ual_daemon.services.vehicle import CommandedVehicle, GimbalVehicle, LocatedVehicle, ServedVehicle

if TYPE_CHECKING:
    from ual_daemon.choice import ServedVehicle as CommandedUav


class Camera(interface.Camera):
    """`ual.interface.Camera`, in this process."""

    def __init__(self, of_vehicle: VehicleCameras, number: int) -> None:
        self._of_vehicle = of_vehicle
        self._number = number

    def __repr__(self) -> str:
        return f"<Camera {self._number}>"

    @override
    def status(self) -> CameraStatus:
        return answer(self._of_vehicle.status(self._number), "GetCameraStatus")

    @override
    def take_photo(self) -> Photo:
        return answer(self._of_vehicle.take_photo(self._number), "TakePhoto")

    @override
    def start_photos(self, *, interval_s: float | None = None, distance_m: float | None = None, count: int = 0) -> None:
        answer(
            self._of_vehicle.start_photos(self._number, interval_s=interval_s, distance_m=distance_m, count=count),
            "StartPhotos",
        )

    @override
    def stop_photos(self) -> None:
        answer(self._of_vehicle.stop_photos(self._number), "StopPhotos")

    @override
    def start_video(self) -> None:
        answer(self._of_vehicle.start_video(self._number), "StartVideo")

    @override
    def stop_video(self) -> None:
        answer(self._of_vehicle.stop_video(self._number), "StopVideo")

    @override
    def set_mode(self, mode: CameraMode) -> None:
        answer(self._of_vehicle.set_mode(self._number, mode=mode), "SetCameraMode")

    @override
    def set_zoom(self, percent: float) -> None:
        answer(self._of_vehicle.set_zoom(self._number, percent=percent), "SetCameraZoom")

    @override
    def set_focus(self, percent: float | None = None) -> None:
        answer(self._of_vehicle.set_focus(self._number, percent=percent), "SetCameraFocus")

    @override
    def photos(self, first: int = 0) -> list[Photo]:
        return self._of_vehicle.photos(self._number, first=first)

    @override
    def streams(self) -> list[VideoStream]:
        return answer(self._of_vehicle.streams(self._number), "ListVideoStreams")

    @override
    def image(self, photo: int | None = None, kind: ImageKind = ImageKind.COLOUR, *, max_age_s: float = 0.0) -> Image:
        return answer(self._of_vehicle.image(self._number, photo=photo, kind=kind, max_age_s=max_age_s), "GetImage")


class Cameras(interface.Cameras):
    """`ual.interface.Cameras`, in this process."""

    def __init__(self, vehicle: LocatedVehicle) -> None:
        self._of_vehicle = VehicleCameras(vehicle)

    @override
    def __getitem__(self, number: int) -> Camera:
        return Camera(self._of_vehicle, number)

    @override
    def __iter__(self) -> Iterator[Camera]:
        return (self[each.number] for each in self.get_all())

    @override
    def get_all(self) -> list[CameraInfo]:
        return self._of_vehicle.get_all()


class Corrections(CorrectionsBase, interface.Corrections):
    """`ual.interface.Corrections`, in this process."""

    def __init__(self, vehicle: ServedVehicle) -> None:
        self._of_vehicle = VehicleCorrections(vehicle)

    @override
    def status(self) -> CorrectionsStatus:
        return self._of_vehicle.status()


class Fence(FenceBase, interface.Fence):
    """`ual.interface.Fence`, in this process."""

    def __init__(self, vehicle: FencedVehicle, lease_id: Callable[[], str]) -> None:
        self._of_vehicle = VehicleFence(vehicle)
        self._lease_id = lease_id

    @override
    def get(self) -> KeptFence:
        return answer(self._of_vehicle.get(), "GetFence")

    @override
    def upload(
        self, plan: FencePlan | None = None, *, replace: bool = False, enable: bool = True, force: bool = False
    ) -> KeptFence:
        return answer(
            self._of_vehicle.upload(plan=plan, replace=replace, enable=enable, force=force, lease_id=self._lease_id()),
            "UploadFence",
        )

    @override
    def clear(self, *, with_rally_points: bool = False, force: bool = False) -> KeptFence:
        return answer(
            self._of_vehicle.clear(with_rally_points=with_rally_points, force=force, lease_id=self._lease_id()),
            "ClearFence",
        )

    @override
    def enable(self) -> KeptFence:
        return answer(self._of_vehicle.enable(lease_id=self._lease_id()), "EnableFence")


class Gimbal(interface.Gimbal):
    """`ual.interface.Gimbal`, in this process."""

    def __init__(self, of_vehicle: VehicleGimbals, number: int) -> None:
        self._of_vehicle = of_vehicle
        self._number = number

    def __repr__(self) -> str:
        return f"<Gimbal {self._number}>"

    @override
    def status(self) -> GimbalStatus:
        return self._of_vehicle.status(self._number)

    @override
    def watch(self, rate_hz: float = 10.0) -> Iterator[GimbalStatus]:
        return answers(self._of_vehicle.watch(self._number, rate_hz=rate_hz), "WatchGimbal")

    @override
    def set_angles(
        self,
        pitch_rad: float,
        yaw_rad: float = 0.0,
        roll_rad: float = 0.0,
        *,
        reference: GimbalReference = GimbalReference.HORIZON,
        frame_id: str = "",
    ) -> None:
        answer(
            self._of_vehicle.set_angles(
                self._number,
                pitch_rad=pitch_rad,
                yaw_rad=yaw_rad,
                roll_rad=roll_rad,
                reference=reference,
                frame_id=frame_id,
            ),
            "SetGimbalAngles",
        )

    @override
    def set_rates(self, pitch_rad_s: float, yaw_rad_s: float = 0.0) -> None:
        answer(self._of_vehicle.set_rates(self._number, pitch_rad_s=pitch_rad_s, yaw_rad_s=yaw_rad_s), "SetGimbalRates")

    @override
    def point_at(self, point: PointStamped | Vector3) -> None:
        answer(self._of_vehicle.point_at(self._number, point=point), "PointGimbal")

    @override
    def move_to_neutral(self) -> None:
        answer(self._of_vehicle.move_to_neutral(self._number), "MoveGimbalToNeutral")

    @override
    def retract(self) -> None:
        answer(self._of_vehicle.retract(self._number), "RetractGimbal")

    @override
    def take_control(self) -> None:
        answer(self._of_vehicle.take_control(self._number), "TakeGimbalControl")

    @override
    def release_control(self) -> None:
        answer(self._of_vehicle.release_control(self._number), "ReleaseGimbalControl")


class Gimbals(interface.Gimbals):
    """`ual.interface.Gimbals`, in this process."""

    def __init__(self, vehicle: GimbalVehicle) -> None:
        self._of_vehicle = VehicleGimbals(vehicle)

    @override
    def __getitem__(self, number: int) -> Gimbal:
        return Gimbal(self._of_vehicle, number)

    @override
    def __iter__(self) -> Iterator[Gimbal]:
        return (self[each.number] for each in self.get_all())

    @override
    def get_all(self) -> list[GimbalInfo]:
        return self._of_vehicle.get_all()


class Gripper(interface.Gripper):
    """`ual.interface.Gripper`, in this process."""

    def __init__(self, vehicle: EquippedVehicle, lease_id: Callable[[], str]) -> None:
        self._of_vehicle = VehicleGripper(vehicle)
        self._lease_id = lease_id

    @override
    def get_all(self) -> Equipment:
        return answer(self._of_vehicle.get_all(), "GetEquipment")

    @override
    def grip(self, gripper: str = "") -> None:
        answer(self._of_vehicle.grip(gripper=gripper, lease_id=self._lease_id()), "Grip")

    @override
    def release(self, gripper: str = "") -> None:
        answer(self._of_vehicle.release(gripper=gripper, lease_id=self._lease_id()), "Release")

    @override
    def order_winch(
        self, action: WinchAction, *, winch: str = "", length_m: float | None = None, rate_m_s: float | None = None
    ) -> None:
        answer(
            self._of_vehicle.order_winch(
                action=action, winch=winch, length_m=length_m, rate_m_s=rate_m_s, lease_id=self._lease_id()
            ),
            "OrderWinch",
        )

    @override
    def set_servo(self, position: str = "", *, servo: str = "", pwm_us: int | None = None) -> None:
        answer(
            self._of_vehicle.set_servo(position=position, servo=servo, pwm_us=pwm_us, lease_id=self._lease_id()),
            "SetServo",
        )

    @override
    def set_relay(self, state: str, *, relay: str = "") -> None:
        answer(self._of_vehicle.set_relay(state=state, relay=relay, lease_id=self._lease_id()), "SetRelay")


class Logs(interface.Logs):
    """`ual.interface.Logs`, in this process."""

    def __init__(self, vehicle: ServedVehicle) -> None:
        self._of_vehicle = VehicleLogs(vehicle)

    @override
    def get_all(self) -> list[Log]:
        return answer(self._of_vehicle.get_all(), "ListLogs")

    @override
    def download(self, log_id: str, offset: int = 0) -> Iterator[LogChunk]:
        return answers(self._of_vehicle.download(log_id=log_id, offset=offset), "DownloadLog")


class Mission(interface.Mission):
    """`ual.interface.Mission`, in this process."""

    def __init__(self, vehicle: CommandedVehicle, lease_id: Callable[[], str]) -> None:
        self._of_vehicle = VehicleMission(vehicle)
        self._lease_id = lease_id

    @override
    def plan(self, items: Sequence[Item]) -> MissionPlan:
        return answer(self._of_vehicle.plan(items=items), "PlanMission")

    @override
    def upload(self, items: Sequence[Item]) -> StoredMission:
        return answer(self._of_vehicle.upload(items=items, lease_id=self._lease_id()), "UploadMission")

    @override
    def download(self) -> StoredMission:
        return answer(self._of_vehicle.download(), "DownloadMission")

    @override
    def clear(self) -> None:
        answer(self._of_vehicle.clear(lease_id=self._lease_id()), "ClearMission")

    @override
    def start(self, first_item: int = 1, on_link_loss: LinkLossAction | None = None) -> TaskInfo:
        return answer(
            self._of_vehicle.start(first_item=first_item, on_link_loss=on_link_loss, lease_id=self._lease_id()),
            "StartMission",
        )

    @override
    def pause(self) -> None:
        self._of_vehicle.pause(lease_id=self._lease_id())

    @override
    def resume(self) -> None:
        self._of_vehicle.resume(lease_id=self._lease_id())

    @override
    def jump_to(self, item: int) -> None:
        answer(self._of_vehicle.jump_to(item=item, lease_id=self._lease_id()), "JumpToItem")

    @override
    def progress(self) -> MissionProgress:
        return self._of_vehicle.progress()

    @override
    def watch(self) -> Iterator[MissionProgress]:
        return answers(self._of_vehicle.watch(), "WatchMission")


class Parachute(interface.Parachute):
    """`ual.interface.Parachute`, in this process."""

    def __init__(self, vehicle: EquippedVehicle, lease_id: Callable[[], str]) -> None:
        self._of_vehicle = VehicleParachute(vehicle)
        self._lease_id = lease_id

    @override
    def ordered(self) -> str:
        return self._of_vehicle.ordered()

    @override
    def enable(self) -> None:
        answer(self._of_vehicle.enable(lease_id=self._lease_id()), "EnableParachute")

    @override
    def disable(self) -> None:
        answer(self._of_vehicle.disable(lease_id=self._lease_id()), "DisableParachute")

    @override
    def release(self) -> None:
        answer(self._of_vehicle.release(lease_id=self._lease_id()), "ReleaseParachute")


class Parameters(interface.Parameters):
    """`ual.interface.Parameters`, in this process."""

    def __init__(self, vehicle: ServedVehicle, lease_id: Callable[[], str]) -> None:
        self._of_vehicle = VehicleParameters(vehicle)
        self._lease_id = lease_id

    @override
    def get(self, name: str) -> Parameter:
        return answer(self._of_vehicle.get(name=name), "GetParameter")

    @override
    def get_all(self) -> list[Parameter]:
        return answer(self._of_vehicle.get_all(), "ListParameters")

    @override
    def set(self, name: str, value: float, *, force: bool = False) -> Parameter:
        return answer(
            self._of_vehicle.set(name=name, value=value, force=force, lease_id=self._lease_id()), "SetParameter"
        )


class ServicesVehicle(CommandedVehicle, EquippedVehicle, FencedVehicle, GimbalVehicle, LocatedVehicle, Protocol):
    """Needs of all services of their UAV."""


class Parts:
    """The services of a UAV."""

    def __init__(self, vehicle: ServicesVehicle, lease_id: Callable[[], str]) -> None:
        self.cameras = Cameras(vehicle)
        self.corrections = Corrections(vehicle)
        self.fence = Fence(vehicle, lease_id)
        self.gimbals = Gimbals(vehicle)
        self.gripper = Gripper(vehicle, lease_id)
        self.logs = Logs(vehicle)
        self.mission = Mission(vehicle, lease_id)
        self.parachute = Parachute(vehicle, lease_id)
        self.parameters = Parameters(vehicle, lease_id)


class PartMembers(interface.Uav):
    """The members of `ual_daemon.UAL` that return its services."""

    @property
    @abstractmethod
    def _parts(self) -> Parts:
        """The services, unless this object is closed."""

    @property
    @override
    def cameras(self) -> Cameras:
        return self._parts.cameras

    @property
    @override
    def corrections(self) -> Corrections:
        return self._parts.corrections

    @property
    @override
    def fence(self) -> Fence:
        return self._parts.fence

    @property
    @override
    def gimbals(self) -> Gimbals:
        return self._parts.gimbals

    @property
    @override
    def gripper(self) -> Gripper:
        return self._parts.gripper

    @property
    @override
    def logs(self) -> Logs:
        return self._parts.logs

    @property
    @override
    def mission(self) -> Mission:
        return self._parts.mission

    @property
    @override
    def parachute(self) -> Parachute:
        return self._parts.parachute

    @property
    @override
    def parameters(self) -> Parameters:
        return self._parts.parameters


class UavMembers(interface.Uav):
    """The members of `ual_daemon.UAL` that only pass on to its vehicle."""

    _lease_id: str

    @property
    @abstractmethod
    def _open(self) -> CommandedUav:
        """The vehicle, unless this object is closed."""

    @override
    def info(self) -> Info:
        return self._open.info()

    @override
    def telemetry(self) -> Telemetry:
        return self._open.telemetry()

    @override
    def transform(self, target_frame_id: str = "", source_frame_id: str = "") -> Transform:
        return self._open.transform(target_frame_id=target_frame_id, source_frame_id=source_frame_id)

    @override
    def frames(self) -> list[Frame]:
        return self._open.frames()

    @override
    def geofence(self) -> Geofence:
        return self._open.geofence()

    @override
    def route(self) -> Route | None:
        return self._open.route()

    @override
    def set_home(self, set_z: bool = False) -> None:
        self._open.commands.set_home(set_z=set_z, lease_id=self._lease_id)

    @override
    def abort(self, freeze: bool = False) -> None:
        self._open.commands.abort(freeze=freeze, lease_id=self._lease_id)

    @override
    def pause(self) -> None:
        self._open.commands.pause(lease_id=self._lease_id)

    @override
    def resume(self) -> None:
        self._open.commands.resume(lease_id=self._lease_id)
