"""Writes the viewer's models as URDF, for rviz2 and others: ``python tools/urdf.py`` into clients/ros2/ual_ros2/urdf.

Each model is one link, ``base_link``, with its meshes beside it as STL. Needs numpy (of the extra ``view``).
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from ual_tools.view.meshes import Mesh
from ual_tools.view.models import MODELS, Model

DIRECTORY = Path(__file__).parents[1] / "clients" / "ros2" / "ual_ros2" / "urdf"
_PACKAGE = "package://ual_ros2/urdf"
_COLOURS = {"body": "0.35 0.4 0.45 1", "nose": "0.9 0.2 0.1 1", "propeller": "0.1 0.1 0.1 1"}
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
"""One of binary STL, after 80 bytes of header and 4 with the number of triangles."""


def main() -> None:
    """Writes all of them."""
    directory = Path(sys.argv[1]) if len(sys.argv) > 1 else DIRECTORY
    for name, content in files():
        (directory / name).write_bytes(content)


def files() -> Iterator[tuple[str, bytes]]:
    """Yields the name and the content of each file."""
    for name, make in MODELS.items():
        model = make()
        for part in _COLOURS:
            yield f"{name}_{part}.stl", stl(getattr(model, part))
        yield f"{name}.urdf", urdf(name, model)


def stl(mesh: Mesh) -> bytes:
    """Returns a mesh as binary STL, in metres."""
    corners = mesh.vertices[mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    triangles = np.zeros(len(corners), TRIANGLE)
    triangles["corners"] = corners
    triangles["normal"] = across / np.linalg.norm(across, axis=1, keepdims=True)
    return bytes(80) + len(corners).to_bytes(4, "little") + triangles.tobytes()


def urdf(name: str, model: Model) -> bytes:
    """Returns the description of a model."""
    robot = ET.Element("robot", name=name)
    for part, colour in _COLOURS.items():
        ET.SubElement(ET.SubElement(robot, "material", name=part), "color", rgba=colour)
    link = ET.SubElement(robot, "link", name="base_link")
    for part, places in (("body", [(0.0, 0.0, 0.0)]), ("nose", [(0.0, 0.0, 0.0)]), ("propeller", model.hubs)):
        for place in places:
            _add_visual(link, name, part, place)
    ET.indent(robot)
    return b'<?xml version="1.0"?>\n' + ET.tostring(robot) + b"\n"


def _add_visual(link: ET.Element, name: str, part: str, place: tuple[float, float, float]) -> None:
    visual = ET.SubElement(link, "visual")
    ET.SubElement(visual, "origin", xyz=" ".join(f"{metres:.4f}" for metres in place))
    ET.SubElement(ET.SubElement(visual, "geometry"), "mesh", filename=f"{_PACKAGE}/{name}_{part}.stl")
    ET.SubElement(visual, "material", name=part)


if __name__ == "__main__":
    main()
