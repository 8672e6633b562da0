"""Pictures of UAL as messages. It needs no ROS: messages are known by their fields.

REP 103: a camera has a second frame, with the suffix ``_optical``: z along its view, x right and y down in its picture.
"""

from __future__ import annotations

import array

import ual
from ual.cameras import OPTICAL, CameraInfo, Image, ImageFormat, Photo
from ual_ros2.services.fields import Fields, Stamp, pose_stamped
from ual_ros2.values import known

_FORMATS = {ImageFormat.PNG: "png", ImageFormat.JPEG: "jpeg"}
_IDENTITY = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]


def frame_of(ns: str, number: int) -> str:
    """Returns the frame of a camera: x along its view, y left and z up in its picture."""
    return f"{ns}/camera_{number}"


def optical_frame_of(ns: str, number: int) -> str:
    """Returns the frame that its messages are in."""
    return f"{frame_of(ns, number)}_optical"


def optical(camera: ual.Pose) -> ual.Pose:
    """Returns the pose of the optical frame, of that of the camera."""
    return ual.Pose(camera.position, camera.orientation * OPTICAL)


def links(ns: str, number: int, image: Image) -> list[ual.Transform]:
    """Returns how the camera is mounted in the body, and its optical frame in it. None where that is not known."""
    if image.body is None or image.camera is None:
        return []
    body, camera = image.body.pose, image.camera.pose
    turn = body.orientation.inverse()
    frame_id = frame_of(ns, number)
    return [
        ual.Transform(
            turn.rotate(camera.position - body.position), turn * camera.orientation, f"{ns}/base_link", frame_id
        ),
        ual.Transform(ual.Vector3(), OPTICAL, frame_id, optical_frame_of(ns, number)),
    ]


def camera_info(camera: CameraInfo | Image) -> Fields:
    """Returns a CameraInfo, but for its header. Matrices of zeros mean that the camera is not calibrated."""
    found = camera.intrinsics
    if found is None:
        return {"width": camera.width_px, "height": camera.height_px}
    fx, fy, cx, cy = found.focal_length_x_px, found.focal_length_y_px, found.centre_x_px, found.centre_y_px
    return {
        "width": found.width_px,
        "height": found.height_px,
        "distortion_model": "plumb_bob",
        "d": [0.0] * 5,
        "r": _IDENTITY,
        "k": [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        "p": [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    }


def viewpoint(taken: Photo | Image) -> Fields:
    """Returns a Viewpoint."""
    camera, at = taken.camera, taken.position_geo
    seen = None if camera is None else ual.PoseStamped(optical(camera.pose), camera.frame_id)
    return {
        "stamp": Stamp(taken.stamp_s),
        "body": pose_stamped(taken.body, taken.stamp_s),
        "optical": pose_stamped(seen, taken.stamp_s),
        "position": {
            "header": {"stamp": Stamp(taken.stamp_s)},
            "latitude": known(None if at is None else at.latitude_deg),
            "longitude": known(None if at is None else at.longitude_deg),
            "altitude": known(None if at is None else at.altitude_ellipsoid_m),
        },
        "altitude_amsl": known(None if at is None else at.altitude_amsl_m),
        "altitude_home": known(None if at is None else at.altitude_home_m),
    }


def compressed(image: Image) -> Fields:
    """Returns a CompressedImage, but for its header."""
    return {"format": _FORMATS[image.format], "data": array.array("B", image.data)}


def distances(image: Image) -> Fields:
    """Returns an Image of metres as REP 118 has it, but for its header."""
    size = {"width": image.width_px, "height": image.height_px, "step": 4 * image.width_px}
    return {**size, "encoding": "32FC1", "is_bigendian": 0, "data": array.array("B", image.data)}
