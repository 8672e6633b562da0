"""The cameras of a small AirSim, as the sources of Cosys-AirSim say (January 2026): pictures of the ground's grid."""

from __future__ import annotations

import math
import struct
from typing import TYPE_CHECKING, Any, Protocol

import msgspec
import numpy as np

from tests.simulators.airsim import Vehicle, vector
from ual.cameras import CameraIntrinsics
from ual.geometry import Pose, Quaternion, Vector3
from ual_daemon.backends.light import painting, png
from ual_daemon.backends.light.scene import PaintedScene

if TYPE_CHECKING:
    from collections.abc import Mapping

LEVEL = Quaternion()
DOWN = Quaternion.from_euler(0.0, math.pi / 2.0, 0.0)
MOUNTS = {
    "front_center": Pose(Vector3(0.5), LEVEL),
    "front_right": Pose(Vector3(0.5, -0.25), LEVEL),
    "front_left": Pose(Vector3(0.5, 0.25), LEVEL),
    "bottom_center": Pose(Vector3(), DOWN),
    "back_center": Pose(Vector3(-0.5), Quaternion.from_yaw(math.pi)),
}
SKY_M = 65504.0
"""The farthest that numbers of 16 bits can say."""
SCENE, DEPTH, RANGE, SEGMENTATION = 0, 1, 2, 5
_HALF = math.sqrt(0.5)


class RefusedError(Exception):
    """A method threw an exception."""


class CrashedError(Exception):
    """The simulator ends: it follows a pointer to a camera that is not there."""


class Server(Protocol):
    """Parts of the simulator that the cameras need."""

    vehicles: dict[str, Vehicle]
    epoch_s: float


class AirsimCameras:
    """Cameras of the simulator. `settings` are those of settings.json."""

    def __init__(self, server: Server) -> None:
        self._server = server
        self.settings: Mapping[str, Any] = {}
        self.view_deg = 90.0
        self.renders = True
        """False: each request of pictures waits for ever, and holds a thread."""
        self.refusal = ""
        """Text of an exception that all requests of pictures throw; empty: they throw none."""
        self.message = ""
        """Why a picture is empty; empty: it is not."""
        self.is_of_microsoft = False
        """Its methods take another argument, and a picture has no `annotation_name`."""

    def get_images(self, requests: list[dict[str, Any]], name: str, *more: bool) -> list[dict[str, Any]]:
        self._require_count("simGetImages", 2, more)
        if self.refusal:
            raise _threw("simGetImages", self.refusal)
        return [self._picture(each, self._server.vehicles[name]) for each in requests]

    def get_camera_info(self, camera: str, name: str, *more: bool) -> dict[str, Any]:
        self._require_count("simGetCameraInfo", 2, more)
        if camera not in self._mounts(name):
            raise CrashedError
        width, height = self._size(SCENE)
        factor = 1.0 / math.tan(math.radians(self.view_deg) / 2.0)
        across, along = (1.0, width / height) if width >= height else (height / width, 1.0)
        matrix = [[0.0, factor * across, 0.0, 0.0], [0.0, 0.0, -factor * along, 0.0], [0.0] * 4, [0.0] * 4]
        pose = {"position": vector((0.0, 0.0, 0.0)), "orientation": _to_ned(Quaternion())}
        return {"pose": pose, "fov": 60.0, "proj_mat": {"matrix": matrix}}

    def _require_count(self, method: str, count: int, more: tuple[bool, ...]) -> None:
        wanted = count + self.is_of_microsoft
        if count + len(more) != wanted:
            text = f"Function '{method}' was called with an invalid number of arguments. Expected: {wanted}, got: "
            raise RefusedError(f"rpclib: {text}{count + len(more)}")

    def _mounts(self, name: str) -> dict[str, Pose]:
        own = self.settings.get("Vehicles", {}).get(name, {}).get("Cameras", {})
        added = {key: Pose(Vector3(*(each.get(axis, 0.0) for axis in "XYZ")), LEVEL) for key, each in own.items()}
        return {**MOUNTS, **added}

    def _size(self, image_type: int) -> tuple[int, int]:
        captures = self.settings.get("CameraDefaults", {}).get("CaptureSettings", [])
        own = [each for each in captures if each.get("ImageType", 0) == image_type]
        return (own[-1].get("Width", 256), own[-1].get("Height", 144)) if own else (256, 144)

    def _picture(self, request: dict[str, Any], vehicle: Vehicle) -> dict[str, Any]:
        mounts = self._mounts(vehicle.name)
        if request["camera_name"] not in mounts:
            raise _threw("simGetImages", "map::at")
        body = _enu(vehicle)
        mount = mounts[request["camera_name"]]
        camera = Pose(body.position + body.orientation.rotate(mount.position), body.orientation * mount.orientation)
        width, height = (0, 0) if self.message else self._size(request["image_type"])
        data, floats = (b"", []) if self.message else self._render(request, camera, width, height)
        east, north, up = camera.position
        answer = {
            "image_data_uint8": data,
            "image_data_float": _as_rpclib(floats),
            "camera_position": vector((north, east, -up)),
            "camera_name": request["camera_name"],
            "camera_orientation": _to_ned(camera.orientation),
            "time_stamp": int((self._server.epoch_s + vehicle.now_s) * 1e9),
            "message": self.message,
            "pixels_as_float": request["pixels_as_float"],
            "compress": request["compress"],
            "width": width,
            "height": height,
            "image_type": request["image_type"],
        }
        return answer if self.is_of_microsoft else {**answer, "annotation_name": ""}

    def _render(self, request: dict[str, Any], camera: Pose, width: int, height: int) -> tuple[bytes, list[float]]:
        """Renders the ground as a light UAV's camera sees it."""
        kind, scene = request["image_type"], PaintedScene(0.0)
        focal_px = max(width, height) / 2.0 / math.tan(math.radians(self.view_deg) / 2.0)
        view = CameraIntrinsics(width, height, focal_px, focal_px, (width - 1) / 2.0, (height - 1) / 2.0)
        if request["pixels_as_float"]:
            measure = {DEPTH: painting.depths, RANGE: painting.ranges}[kind]
            return b"", np.minimum(measure(camera, view, scene).ravel(), SKY_M).tolist()
        paint = {SCENE: painting.paint, SEGMENTATION: painting.segments}[kind]
        return png.encode(paint(camera, view, scene)), []


def _threw(method: str, text: str) -> RefusedError:
    prefix = f"rpclib: function '{method}' threw an exception. The exception contained this information: "
    return RefusedError(f"{prefix}{text}.")


def _enu(vehicle: Vehicle) -> Pose:
    """Returns the pose of a vehicle: east, north, up."""
    north, east, down = vehicle.body.position
    roll, pitch = vehicle.body.tilt
    turn = Quaternion.from_euler(roll, -pitch, math.pi / 2.0 - vehicle.body.yaw_rad)
    return Pose(Vector3(east, north, -down), turn)


def _to_ned(turn: Quaternion) -> dict[str, float]:
    """From forward, left, up to east, north, up as the simulator says it: forward, right, down to north, east, down."""
    x, y, z, w = turn
    return {"w_val": _HALF * (z + w), "x_val": _HALF * (x + y), "y_val": _HALF * (x - y), "z_val": _HALF * (w - z)}


def _as_rpclib(floats: list[float]) -> msgspec.Raw:
    """An array of numbers of 32 bits."""
    head = struct.pack(">BI", 0xDD, len(floats))
    return msgspec.Raw(head + b"".join(struct.pack(">Bf", 0xCA, each) for each in floats))
