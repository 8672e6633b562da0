"""Output from the contract for ROS 2: ``ual_msgs``, and the code of ``ual_ros2`` that fills and reads it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from google.protobuf.descriptor_pb2 import FileDescriptorSet

from tools.contract import ros_names
from tools.contract.ros_code import code
from tools.contract.ros_interfaces import PACKAGE, interfaces
from tools.contract.ros_page import page
from tools.contract.ros_shapes import Shapes


def derived(contract: FileDescriptorSet) -> dict[Path, str]:
    """Returns the files, by path.

    Raises:
        SystemExit: The table of what is otherwise names something that is not in the contract.

    """
    shapes = Shapes(contract)
    made = {**interfaces(shapes), **code(shapes), **page(shapes.served())}
    if unknown := shapes.unknown():
        raise SystemExit(f"ros_names.py names what the contract has not: {', '.join(unknown)}")
    return made


def files() -> Iterator[Path]:
    """Yields the interfaces that are there, and are not written by hand."""
    return (path for path in PACKAGE.glob("*/*.*") if path.name not in ros_names.BY_HAND)
