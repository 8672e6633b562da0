"""Lands on an ArUco marker that the camera sees, with wind and noise.

``python examples/land_on_marker.py``; it needs OpenCV (``pip install opencv-python-headless``).
"""

import argparse
import math
from typing import Any

import cv2
import numpy as np

import ual
from ual.cameras import OPTICAL, Image
from ual_daemon import UAL

MARKER = (1.8, -0.7)
HEIGHTS_M = (6.0, 4.0, 2.0, 1.2)
"""The marker is looked for at each of these, the last one just before the landing."""
SETTINGS = {
    "speed_factor": 20.0,
    "position_noise_m": 0.03,
    "wind_m_s": [1.0, -0.5, 0.0],
    "cameras": [{"noise": 6.0, "markers": [{"position": MARKER, "size_m": 0.6, "yaw_rad": 0.3}]}],
}

detector: Any = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))


def find(image: Image) -> ual.Vector3:
    """Returns the marker's position on the ground, in odom: on the ray through its centre in the picture."""
    picture: Any = cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_GRAYSCALE)
    corners, ids, _ = detector.detectMarkers(picture)
    if ids is None:
        raise SystemExit("no marker is seen")
    assert image.intrinsics is not None
    assert image.camera is not None
    lens, camera = image.intrinsics, image.camera.pose
    column, row = corners[0][0].mean(axis=0)
    x = (float(column) - lens.centre_x_px) / lens.focal_length_x_px
    y = (float(row) - lens.centre_y_px) / lens.focal_length_y_px
    ray = (camera.orientation * OPTICAL).rotate(ual.Vector3(x, y, 1.0))
    return camera.position - ray * (camera.position.z / ray.z)


def land_on_marker(uav: ual.interface.Uav) -> None:
    """Goes down over the marker, which it sees better each time, and lands."""
    for height_m in HEIGHTS_M:
        place = find(uav.cameras[0].image())
        uav.go_to_waypoint(ual.Pose.at(place.x, place.y, height_m))
    uav.land()


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    with UAL("light", backend_settings=SETTINGS) as uav:
        uav.arm()
        uav.take_off(HEIGHTS_M[0])
        land_on_marker(uav)
        landed = uav.pose().pose.position
        print(f"landed {math.dist(MARKER, (landed.x, landed.y)):.2f} m from the marker")


if __name__ == "__main__":
    main()
