"""The services beside that of the UAV. ``make clients`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from typing_extensions import override

from ual import (
    _camera_calls,
    _cameras_calls,
    _fence_calls,
    _gimbal_calls,
    _gimbals_calls,
    _log_calls,
    _mission_calls,
    _parameter_calls,
    interface,
)
from ual._connection import Connection
from ual._service_calls import gripper as _gripper_calls
from ual.cameras import CameraInfo, CameraMode, CameraStatus, Image, ImageKind, Photo, VideoStream
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
    def get_all(self) -> list[CameraInfo]:
        return self._connection.run(_cameras_calls.get_all())


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
    def get_all(self) -> list[GimbalInfo]:
        return self._connection.run(_gimbals_calls.get_all())


class Parameters(interface.Parameters):
    """`ual.interface.Parameters`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Parameters of {self._connection.described}>"

    @override
    def get(self, name: str) -> Parameter:
        return self._connection.run(_parameter_calls.get(name))

    @override
    def get_all(self) -> list[Parameter]:
        return self._connection.run(_parameter_calls.get_all())

    @override
    def set(self, name: str, value: float, *, force: bool = False) -> Parameter:
        return self._connection.run(_parameter_calls.set_(name=name, value=value, force=force))


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
        return self._connection.run(_fence_calls.upload(plan, replace=replace, enable=enable, force=force))

    @override
    def clear(self, *, with_rally_points: bool = False, force: bool = False) -> KeptFence:
        return self._connection.run(_fence_calls.clear(with_rally_points=with_rally_points, force=force))

    @override
    def enable(self) -> KeptFence:
        return self._connection.run(_fence_calls.enable())

    @override
    def disable(self) -> KeptFence:
        return self._connection.run(_fence_calls.disable())


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
        self._connection.run(_gripper_calls.order_winch(action, winch=winch, length_m=length_m, rate_m_s=rate_m_s))

    @override
    def set_servo(self, position: str = "", *, servo: str = "", pwm_us: int | None = None) -> None:
        self._connection.run(_gripper_calls.set_servo(position, servo=servo, pwm_us=pwm_us))

    @override
    def set_relay(self, state: str, *, relay: str = "") -> None:
        self._connection.run(_gripper_calls.set_relay(state, relay=relay))


class Logs(interface.Logs):
    """`ual.interface.Logs`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Logs of {self._connection.described}>"

    @override
    def get_all(self) -> list[Log]:
        return self._connection.run(_log_calls.get_all())

    @override
    def download(self, log_id: str, offset: int = 0) -> Iterator[LogChunk]:
        return self._connection.iterate(_log_calls.download(log_id=log_id, offset=offset))
