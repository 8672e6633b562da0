"""The services beside that of the UAV. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from typing_extensions import override

from ual import interface
from ual._connection import Connection
from ual._corrections import CorrectionsBase
from ual._service_calls import camera as _camera_calls
from ual._service_calls import corrections as _corrections_calls
from ual._service_calls import fence as _fence_calls
from ual._service_calls import gimbal as _gimbal_calls
from ual._service_calls import gripper as _gripper_calls
from ual._service_calls import logs as _logs_calls
from ual._service_calls import mission as _mission_calls
from ual._service_calls import parachute as _parachute_calls
from ual._service_calls import parameters as _parameters_calls
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


class Camera(interface.Camera):
    """`ual.interface.Camera`, over gRPC."""

    def __init__(self, connection: Connection, number: int) -> None:
        self._connection = connection
        self._number = number

    def __repr__(self) -> str:
        return f"<Camera {self._number} of {self._connection.described}>"

    @override
    def status(self) -> CameraStatus:
        return self._connection.run(_camera_calls.status(self._number))

    @override
    def take_photo(self) -> Photo:
        return self._connection.run(_camera_calls.take_photo(self._number))

    @override
    def start_photos(self, *, interval_s: float | None = None, distance_m: float | None = None, count: int = 0) -> None:
        self._connection.run(
            _camera_calls.start_photos(self._number, interval_s=interval_s, distance_m=distance_m, count=count)
        )

    @override
    def stop_photos(self) -> None:
        self._connection.run(_camera_calls.stop_photos(self._number))

    @override
    def start_video(self) -> None:
        self._connection.run(_camera_calls.start_video(self._number))

    @override
    def stop_video(self) -> None:
        self._connection.run(_camera_calls.stop_video(self._number))

    @override
    def set_mode(self, mode: CameraMode) -> None:
        self._connection.run(_camera_calls.set_mode(self._number, mode))

    @override
    def set_zoom(self, percent: float) -> None:
        self._connection.run(_camera_calls.set_zoom(self._number, percent))

    @override
    def set_focus(self, percent: float | None = None) -> None:
        self._connection.run(_camera_calls.set_focus(self._number, percent))

    @override
    def photos(self, first: int = 0) -> list[Photo]:
        return self._connection.run(_camera_calls.photos(self._number, first))

    @override
    def streams(self) -> list[VideoStream]:
        return self._connection.run(_camera_calls.streams(self._number))

    @override
    def image(self, photo: int | None = None, kind: ImageKind = ImageKind.COLOUR, *, max_age_s: float = 0.0) -> Image:
        return self._connection.run(_camera_calls.image(self._number, photo=photo, kind=kind, max_age_s=max_age_s))


class Cameras(interface.Cameras):
    """`ual.interface.Cameras`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Cameras of {self._connection.described}>"

    @override
    def __getitem__(self, number: int) -> Camera:
        return Camera(self._connection, number)

    @override
    def __iter__(self) -> Iterator[Camera]:
        return (self[each.number] for each in self.get_all())

    @override
    def get_all(self) -> list[CameraInfo]:
        return self._connection.run(_camera_calls.get_all())


class Corrections(CorrectionsBase, interface.Corrections):
    """`ual.interface.Corrections`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Corrections of {self._connection.described}>"

    @override
    def status(self) -> CorrectionsStatus:
        return self._connection.run(_corrections_calls.status())


class Fence(interface.Fence):
    """`ual.interface.Fence`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Fence of {self._connection.described}>"

    @override
    def get(self) -> KeptFence:
        return self._connection.run(_fence_calls.get())

    @override
    def upload(
        self, plan: FencePlan | None = None, *, replace: bool = False, enable: bool = True, force: bool = False
    ) -> KeptFence:
        return self._connection.run(_fence_calls.upload(plan=plan, replace=replace, enable=enable, force=force))

    @override
    def clear(self, *, with_rally_points: bool = False, force: bool = False) -> KeptFence:
        return self._connection.run(_fence_calls.clear(with_rally_points=with_rally_points, force=force))

    @override
    def enable(self) -> KeptFence:
        return self._connection.run(_fence_calls.enable())

    @override
    def disable(self) -> KeptFence:
        return self._connection.run(_fence_calls.disable())


class Gimbal(interface.Gimbal):
    """`ual.interface.Gimbal`, over gRPC."""

    def __init__(self, connection: Connection, number: int) -> None:
        self._connection = connection
        self._number = number

    def __repr__(self) -> str:
        return f"<Gimbal {self._number} of {self._connection.described}>"

    @override
    def status(self) -> GimbalStatus:
        return self._connection.run(_gimbal_calls.status(self._number))

    @override
    def watch(self, rate_hz: float = 10.0) -> Iterator[GimbalStatus]:
        return self._connection.iterate(_gimbal_calls.watch(self._number, rate_hz))

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
        self._connection.run(
            _gimbal_calls.set_angles(
                self._number,
                pitch_rad=pitch_rad,
                yaw_rad=yaw_rad,
                roll_rad=roll_rad,
                reference=reference,
                frame_id=frame_id,
            )
        )

    @override
    def set_rates(self, pitch_rad_s: float, yaw_rad_s: float = 0.0) -> None:
        self._connection.run(_gimbal_calls.set_rates(self._number, pitch_rad_s=pitch_rad_s, yaw_rad_s=yaw_rad_s))

    @override
    def point_at(self, point: PointStamped | Vector3) -> None:
        self._connection.run(_gimbal_calls.point_at(self._number, point))

    @override
    def move_to_neutral(self) -> None:
        self._connection.run(_gimbal_calls.move_to_neutral(self._number))

    @override
    def retract(self) -> None:
        self._connection.run(_gimbal_calls.retract(self._number))

    @override
    def take_control(self) -> None:
        self._connection.run(_gimbal_calls.take_control(self._number))

    @override
    def release_control(self) -> None:
        self._connection.run(_gimbal_calls.release_control(self._number))


class Gimbals(interface.Gimbals):
    """`ual.interface.Gimbals`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Gimbals of {self._connection.described}>"

    @override
    def __getitem__(self, number: int) -> Gimbal:
        return Gimbal(self._connection, number)

    @override
    def __iter__(self) -> Iterator[Gimbal]:
        return (self[each.number] for each in self.get_all())

    @override
    def get_all(self) -> list[GimbalInfo]:
        return self._connection.run(_gimbal_calls.get_all())


class Gripper(interface.Gripper):
    """`ual.interface.Gripper`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Gripper of {self._connection.described}>"

    @override
    def get_all(self) -> Equipment:
        return self._connection.run(_gripper_calls.get_all())

    @override
    def grip(self, gripper: str = "") -> None:
        self._connection.run(_gripper_calls.grip(gripper))

    @override
    def release(self, gripper: str = "") -> None:
        self._connection.run(_gripper_calls.release(gripper))

    @override
    def order_winch(
        self, action: WinchAction, *, winch: str = "", length_m: float | None = None, rate_m_s: float | None = None
    ) -> None:
        self._connection.run(
            _gripper_calls.order_winch(action=action, winch=winch, length_m=length_m, rate_m_s=rate_m_s)
        )

    @override
    def set_servo(self, position: str = "", *, servo: str = "", pwm_us: int | None = None) -> None:
        self._connection.run(_gripper_calls.set_servo(position=position, servo=servo, pwm_us=pwm_us))

    @override
    def set_relay(self, state: str, *, relay: str = "") -> None:
        self._connection.run(_gripper_calls.set_relay(state=state, relay=relay))


class Logs(interface.Logs):
    """`ual.interface.Logs`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Logs of {self._connection.described}>"

    @override
    def get_all(self) -> list[Log]:
        return self._connection.run(_logs_calls.get_all())

    @override
    def download(self, log_id: str, offset: int = 0) -> Iterator[LogChunk]:
        return self._connection.iterate(_logs_calls.download(log_id=log_id, offset=offset))


class Mission(interface.Mission):
    """`ual.interface.Mission`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Mission of {self._connection.described}>"

    @override
    def plan(self, items: Sequence[Item]) -> MissionPlan:
        return self._connection.run(_mission_calls.plan(items))

    @override
    def upload(self, items: Sequence[Item]) -> StoredMission:
        return self._connection.run(_mission_calls.upload(items))

    @override
    def download(self) -> StoredMission:
        return self._connection.run(_mission_calls.download())

    @override
    def clear(self) -> None:
        self._connection.run(_mission_calls.clear())

    @override
    def start(self, first_item: int = 1, on_link_loss: LinkLossAction | None = None) -> TaskInfo:
        return self._connection.run(_mission_calls.start(first_item=first_item, on_link_loss=on_link_loss))

    @override
    def pause(self) -> None:
        self._connection.run(_mission_calls.pause())

    @override
    def resume(self) -> None:
        self._connection.run(_mission_calls.resume())

    @override
    def jump_to(self, item: int) -> None:
        self._connection.run(_mission_calls.jump_to(item))

    @override
    def progress(self) -> MissionProgress:
        return self._connection.run(_mission_calls.progress())

    @override
    def watch(self) -> Iterator[MissionProgress]:
        return self._connection.iterate(_mission_calls.watch())


class Parachute(interface.Parachute):
    """`ual.interface.Parachute`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Parachute of {self._connection.described}>"

    @override
    def ordered(self) -> str:
        return self._connection.run(_parachute_calls.ordered())

    @override
    def enable(self) -> None:
        self._connection.run(_parachute_calls.enable())

    @override
    def disable(self) -> None:
        self._connection.run(_parachute_calls.disable())

    @override
    def release(self) -> None:
        self._connection.run(_parachute_calls.release())


class Parameters(interface.Parameters):
    """`ual.interface.Parameters`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Parameters of {self._connection.described}>"

    @override
    def get(self, name: str) -> Parameter:
        return self._connection.run(_parameters_calls.get(name))

    @override
    def get_all(self) -> list[Parameter]:
        return self._connection.run(_parameters_calls.get_all())

    @override
    def set(self, name: str, value: float, *, force: bool = False) -> Parameter:
        return self._connection.run(_parameters_calls.set_(name=name, value=value, force=force))


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


class PartMembers(interface.Uav):
    """The members of `ual.Uav` that return its services."""

    _parts: Parts

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
