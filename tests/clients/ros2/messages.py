"""Messages as a test without ROS makes them: objects with the same fields."""

from __future__ import annotations

from types import SimpleNamespace

import ual


def stamp(sec: int = 0, nanosec: int = 0) -> SimpleNamespace:
    return SimpleNamespace(sec=sec, nanosec=nanosec)


def header(frame_id: str = "") -> SimpleNamespace:
    return SimpleNamespace(frame_id=frame_id, stamp=stamp())


def vector(value: ual.Vector3 | None = None) -> SimpleNamespace:
    given = value or ual.Vector3()
    return SimpleNamespace(x=given.x, y=given.y, z=given.z)


def quaternion(value: ual.Quaternion | None = None) -> SimpleNamespace:
    given = value or ual.Quaternion()
    return SimpleNamespace(x=given.x, y=given.y, z=given.z, w=given.w)


def pose() -> SimpleNamespace:
    return SimpleNamespace(position=vector(), orientation=quaternion())


def twist() -> SimpleNamespace:
    return SimpleNamespace(linear=vector(), angular=vector())


def transform_stamped() -> SimpleNamespace:
    moved = SimpleNamespace(translation=vector(), rotation=quaternion())
    return SimpleNamespace(header=header(), child_frame_id="", transform=moved)
