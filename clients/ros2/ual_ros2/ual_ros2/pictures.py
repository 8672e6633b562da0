"""Pictures of UAL as messages. It needs no ROS: messages are known by their fields.

REP 103: a camera has a second frame, with the suffix ``_optical``: z along its view, x right and y down in its picture.
"""

from __future__ import annotations

import array

import ual
from ual.cameras import OPTICAL, CameraInfo, CameraIntrinsics, Image, ImageFormat, Photo
from ual_ros2.beside.fields import Fields, Stamp, made, pose_stamped
from ual_ros2.messages import Message
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


def fill_camera_info(message: Message, width_px: int, height_px: int, found: CameraIntrinsics | None) -> None:
    """Fills a CameraInfo, but for its header. Matrices of zeros mean that the camera is not calibrated."""
    message.width, message.height = width_px, height_px
    message.distortion_model = "" if found is None else "plumb_bob"
    message.d = [] if found is None else [0.0] * 5
    message.r = [0.0] * 9 if found is None else _IDENTITY
    fx, fy, cx, cy = (
        (0.0, 0.0, 0.0, 0.0)
        if found is None
        else (found.focal_length_x_px, found.focal_length_y_px, found.centre_x_px, found.centre_y_px)
    )
    one = 0.0 if found is None else 1.0
    message.k = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, one]
    message.p = [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, one, 0.0]


def camera_info(camera: CameraInfo | Image) -> Fields:
    """Returns a CameraInfo, but for its header."""
    found = camera.intrinsics
    size = (camera.width_px, camera.height_px) if found is None else (found.width_px, found.height_px)
    return made(fill_camera_info, *size, found)


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


def fill_compressed(message: Message, image: Image) -> None:
    """Fills a CompressedImage, but for its header."""
    message.format = _FORMATS[image.format]
    message.data = array.array("B", image.data)


def fill_distances(message: Message, image: Image) -> None:
    """Fills an Image of metres as REP 118 has it, but for its header."""
    message.width, message.height, message.step = image.width_px, image.height_px, 4 * image.width_px
    message.encoding, message.is_bigendian = "32FC1", 0
    message.data = array.array("B", image.data)
