"""The models for rviz2 are those of the viewer."""

from __future__ import annotations

import io
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from numpy.typing import NDArray

from tools import urdf
from ual_tools.view.models import MODELS

FILES = dict(urdf.files())


def triangles(content: bytes) -> NDArray[np.float32]:
    """The corners of an STL file."""
    return np.frombuffer(content[84:], urdf.TRIANGLE)["corners"].astype(np.float32)


def test_the_files_are_those_of_the_models() -> None:
    there = {path.name: path.read_bytes() for path in urdf.DIRECTORY.iterdir()}
    assert there.keys() == FILES.keys()
    for name, content in FILES.items():
        if name.endswith(".urdf"):
            assert there[name] == content, "python tools/urdf.py"
        else:
            assert triangles(there[name]) == pytest.approx(triangles(content), abs=1e-6), "python tools/urdf.py"


@pytest.mark.parametrize("name", MODELS)
def test_a_description_is_one_link_with_meshes_that_are_there(name: str) -> None:
    robot = ET.fromstring(FILES[f"{name}.urdf"])
    assert [link.get("name") for link in robot.findall("link")] == ["base_link"]
    meshes = [str(mesh.get("filename")) for mesh in robot.iter("mesh")]
    assert len(meshes) == 2 + len(MODELS[name]().hubs)
    assert {file.removeprefix("package://ual_ros2/urdf/") for file in meshes} <= FILES.keys()


@pytest.mark.parametrize("name", MODELS)
def test_another_reader_finds_the_mesh_as_it_is(name: str) -> None:
    import trimesh  # late: it takes half a second of each worker of the tests

    body = MODELS[name]().body
    read = trimesh.load(io.BytesIO(FILES[f"{name}_body.stl"]), file_type="stl")
    assert isinstance(read, trimesh.Trimesh)
    assert len(read.faces) == len(body.faces)
    assert read.bounds == pytest.approx(trimesh.Trimesh(body.vertices, body.faces).bounds)
