"""Names that programs in ROS rely on stay: the type and the place of each field, and each name that is served."""

from __future__ import annotations

from tests.clients.ros2.record import REMEDY, found, recorded


def test_what_programs_in_ros_rely_on_is_kept() -> None:
    lost = recorded() - found()
    assert not lost, REMEDY


def test_what_is_new_is_recorded() -> None:
    new = found() - recorded()
    assert not new, "make wire"
