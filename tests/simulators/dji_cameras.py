"""The camera and the gimbal module of psdk_ros2, as their sources have it (053f357, September 2024)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from tests.simulators.rosbridge import Message, Service


@dataclass
class Camera:
    """A camera at a port. An order that is in `refuses` is refused."""

    total_mib: int = 64_000
    free_mib: int = 32_000
    zoom_factor: float = 1.0
    max_zoom_factor: float = 5.0
    photos_count: int = 0
    interval: tuple[int, int] | None = None
    is_recording: bool = False
    focus_mode: int = 0
    refuses: set[str] = field(default_factory=set)


class CameraModule:
    """Its services. An answer says only whether DJI's SDK has taken the order; the type of a camera is always empty."""

    def __init__(self) -> None:
        self.cameras: dict[int, Camera] = {}
        self.calls: list[tuple[str, Message]] = []

    @property
    def services(self) -> Mapping[str, Service]:
        answers: Mapping[str, Callable[[Camera, Message], Message]] = {
            "get_type": lambda *_: {"camera_type": ""},
            "shoot_single_photo": self._shoot,
            "shoot_interval_photo": self._shoot_interval,
            "stop_shoot_photo": self._stop,
            "record_video": self._record,
            "get_sd_storage_info": lambda camera, _: {
                "total_capacity": camera.total_mib,
                "remain_capacity": camera.free_mib,
            },
            "get_optical_zoom": lambda camera, _: {
                "zoom_factor": camera.zoom_factor,
                "max_zoom_factor": camera.max_zoom_factor,
            },
            "set_optical_zoom": self._zoom,
            "set_focus_mode": self._focus,
        }
        return {f"/psdk_ros2/camera_{name}": self._served(name, answer) for name, answer in answers.items()}

    def _served(self, name: str, answer: Callable[[Camera, Message], Message]) -> Service:
        def call(asked: Message) -> Message:
            self.calls.append((name, asked))
            camera = self.cameras.get(asked["payload_index"])
            if camera is None or name in camera.refuses:
                return {"success": False}
            return {"success": True, **answer(camera, asked)}

        return call

    def _shoot(self, camera: Camera, _: Message) -> Message:
        camera.photos_count += 1
        return {}

    def _shoot_interval(self, camera: Camera, asked: Message) -> Message:
        camera.interval = (asked["num_photos_to_capture"], asked["time_interval"])
        return {}

    def _stop(self, camera: Camera, _: Message) -> Message:
        camera.interval = None
        return {}

    def _record(self, camera: Camera, asked: Message) -> Message:
        camera.is_recording = asked["start_stop"]
        return {}

    def _zoom(self, camera: Camera, asked: Message) -> Message:
        camera.zoom_factor = asked["zoom_factor"]
        return {}

    def _focus(self, camera: Camera, asked: Message) -> Message:
        camera.focus_mode = asked["focus_mode"]
        return {}


@dataclass
class GimbalModule:
    """The gimbal at port 1, which is at once where it is to be. Angles as the wrapper has them: yaw from east."""

    is_mounted: bool = False
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rad: float = 0.0
    is_pitch_limited: bool = False
    refuses_reset: bool = False
    rotations: list[Message] = field(default_factory=list)

    @property
    def services(self) -> Mapping[str, Service]:
        return {"/psdk_ros2/gimbal_reset": self._reset}

    @property
    def subscriptions(self) -> Mapping[str, tuple[str, Callable[[Message], None]]]:
        return {"/psdk_ros2/gimbal_rotation": ("psdk_interfaces/GimbalRotation", self._rotate)}

    def angles(self) -> Message:
        """Returns the published angles."""
        return {"vector": {"x": self.roll_rad, "y": self.pitch_rad, "z": self.yaw_rad}}

    def status(self) -> Message:
        """Returns the published flags."""
        flags = ("roll_limited", "yaw_limited", "calibrating", "gyro_falut", "fw_updating")
        limited = int(self.is_pitch_limited)
        return {"mount_status": int(self.is_mounted), "pitch_limited": limited, **dict.fromkeys(flags, 0)}

    def _rotate(self, message: Message) -> None:
        self.rotations.append(message)
        assert (message["payload_index"], message["rotation_mode"]) == (1, 1)
        self.roll_rad, self.pitch_rad, self.yaw_rad = message["roll"], message["pitch"], message["yaw"]

    def _reset(self, asked: Message) -> Message:
        assert asked == {"payload_index": 1, "reset_mode": 1}
        if self.refuses_reset:
            return {"success": False}
        self.pitch_rad = self.yaw_rad = 0.0
        return {"success": True}
