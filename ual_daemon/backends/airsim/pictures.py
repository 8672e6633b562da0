"""Pictures as the simulator sends them: what is requested, and what an answer means."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from ual.cameras import CameraIntrinsics, ImageFormat, ImageKind
from ual.geometry import Pose
from ual_daemon.backends.airsim.camera_settings import TYPES, NamedCamera
from ual_daemon.backends.airsim.state import Rotation, Vector

_FLOAT32_CODE = 0xCA
_SKY_DISTANCE_M = 65504.0
"""The largest number of 16 bits, in which the simulator renders distances: that of the sky."""
_TANGENT_TOLERANCE = 1e-3
_PNG = b"\x89PNG\r\n\x1a\n"
_OF_DISTANCE = frozenset({ImageKind.DEPTH, ImageKind.RANGE})


class EmptyPictureError(Exception):
    """The simulator has rendered nothing; the message says why, human-readable."""


class AirsimPicture(msgspec.Struct, frozen=True):
    """One answer of ``simGetImages``. Where the camera was is north, east, down from where the vehicle began."""

    image_data_uint8: bytes | list[int]
    image_data_float: msgspec.Raw
    camera_position: Vector
    camera_orientation: Rotation
    time_stamp: int
    message: str
    width: int
    height: int

    @property
    def stamp_s(self) -> float:
        """The simulator's time when it was rendered."""
        return self.time_stamp * 1e-9

    @property
    def camera(self) -> Pose:
        """The pose of the camera in the vehicle's local frame: x along its view, y left, z up."""
        return Pose(self.camera_position.to_enu(), self.camera_orientation.to_enu())


class CameraProjection(msgspec.Struct, frozen=True):
    """A matrix from x along the view, y right, z down."""

    matrix: list[list[float]]


class CameraState(msgspec.Struct, frozen=True):
    """The answer to ``simGetCameraInfo``. Its pose is in other frames by version, and its angle is the viewport's."""

    proj_mat: CameraProjection

    @property
    def tangent(self) -> float | None:
        """The tangent of half the angle of the scene's view along the longer side; None where the matrix has none."""
        rows = self.proj_mat.matrix
        factors = [abs(rows[0][1]), abs(rows[1][2])] if len(rows) > 1 and len(rows[0]) > 1 and len(rows[1]) > 2 else []
        least = min(factors, default=math.nan)
        return 1.0 / least if math.isfinite(least) and least > 0.0 else None


def request_of(camera: str, kind: ImageKind) -> dict[str, Any]:
    """Returns a request of ``simGetImages``."""
    is_distance = kind in _OF_DISTANCE
    return {
        "camera_name": camera,
        "image_type": TYPES[kind],
        "pixels_as_float": is_distance,
        "compress": not is_distance,
        "annotation_name": "",
    }


def data_of(picture: AirsimPicture, kind: ImageKind) -> tuple[bytes, ImageFormat]:
    """Returns the bytes of a picture, and how they are encoded.

    Raises:
        EmptyPictureError: Nothing was rendered, or something else than was requested.

    """
    if picture.message or not picture.width or not picture.height:
        raise EmptyPictureError(picture.message or "the picture is empty")
    if kind not in _OF_DISTANCE:
        data = bytes(picture.image_data_uint8)
        if not data.startswith(_PNG):
            raise EmptyPictureError("what came is no PNG")
        return data, ImageFormat.PNG
    distances = _floats(picture.image_data_float)
    if distances.size != picture.width * picture.height:
        raise EmptyPictureError(f"{distances.size} distances came for {picture.width} x {picture.height} pixels")
    return np.where(distances >= _SKY_DISTANCE_M, np.inf, distances).astype("<f4").tobytes(), ImageFormat.FLOAT32


def intrinsics_of(
    camera: NamedCamera, kind: ImageKind, width_px: int, height_px: int, tangent: float | None
) -> CameraIntrinsics | None:
    """Returns how points lie in a picture; None where that is not known.

    Args:
        camera: Its settings.
        kind: The kind of the picture.
        width_px: Of the picture.
        height_px: Of the picture.
        tangent: That of the scene's view, as the simulator says it now.

    """
    scene, own = camera.capture(ImageKind.COLOUR), camera.capture(kind)
    if not own.is_pinhole or not scene.is_pinhole:
        return None
    if own.view_deg != scene.view_deg and tangent is not None:
        # The settings give it a view of its own: unless another program has changed that of all kinds since.
        is_as_set = scene.tangent is not None and math.isclose(tangent, scene.tangent, rel_tol=_TANGENT_TOLERANCE)
        tangent = own.tangent if is_as_set else None
    if tangent is None:
        return None
    focal_px = 0.5 * max(width_px, height_px) / tangent
    return CameraIntrinsics(width_px, height_px, focal_px, focal_px, 0.5 * (width_px - 1), 0.5 * (height_px - 1))


def _floats(encoded: msgspec.Raw) -> NDArray[np.float64] | NDArray[np.float32]:
    """Returns an array of numbers. Those of 32 bits are read at once: there are a million of them."""
    data = np.frombuffer(bytes(encoded), np.uint8)
    head = {0xDC: 3, 0xDD: 5}.get(int(data[0]), 1) if data.size else 1
    body = data[head:]
    if body.size and body.size % 5 == 0 and bool((body[::5] == _FLOAT32_CODE).all()):
        return np.ascontiguousarray(body.reshape(-1, 5)[:, 1:]).view(">f4").ravel()
    return np.array(msgspec.msgpack.decode(encoded, type=list[float]), np.float64)
