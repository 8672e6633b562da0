"""Installs the node as an ament_python package; ROS' tools find it by what stands in share."""

from pathlib import Path

from setuptools import setup

NAME = "ual_ros2"
HERE = Path(__file__).parent


def shared(folder: str) -> tuple[str, list[str]]:
    """The files of a folder, and where they are installed."""
    files = sorted(str(file.relative_to(HERE)) for file in (HERE / folder).glob("*") if file.is_file())
    return f"share/{NAME}/{folder}", files


setup(
    name=NAME,
    version="0.3.0",
    packages=[NAME, f"{NAME}.services", f"{NAME}.derived"],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"lib/{NAME}", ["scripts/node"]),
        *map(shared, ("launch", "rviz", "urdf")),
    ],
    install_requires=["setuptools", "ual-client"],
    zip_safe=True,
    description="UAVs of the UAV abstraction layer (UAL) as a ROS 2 node: a client of their daemons",
    license="Apache-2.0",
)
