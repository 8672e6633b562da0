"""`ual_msgs` is whole: CMake makes each interface, and each has the numbers and the errors of the contract."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

import ual
from ual.types import AltitudeReference, PathHeading, State

ROOT = Path(__file__).parents[3]
PACKAGE = ROOT / "clients" / "ros2" / "ual_msgs"
INTERFACES = sorted(
    path.relative_to(PACKAGE) for kind in ("msg", "srv", "action") for path in (PACKAGE / kind).iterdir()
)
ANSWERS = [path for path in INTERFACES if path.suffix in (".srv", ".action")]
OUTCOME = ["bool success", "string reason", "string message", "diagnostic_msgs/KeyValue[] metadata"]


def parts(path: Path) -> list[list[str]]:
    """The declarations of a file without comments, by its parts: request and answer, and feedback."""
    lines = [re.sub(r"\s*#.*", "", line) for line in (PACKAGE / path).read_text(encoding="utf-8").splitlines()]
    return [[line for line in part.splitlines() if line] for part in "\n".join(lines).split("---")]


def numbers(path: str) -> dict[str, int]:
    """The constants of a file."""
    text = (PACKAGE / path).read_text(encoding="utf-8")
    return {name: int(number) for name, number in re.findall(r"^uint8 ([A-Z_]+) = (\d+)", text, re.MULTILINE)}


def depth(name: str) -> int:
    """How deep messages of this package are in one: it comes after them, as all are compiled as one (unite.cmake)."""
    own = {path.stem for path in INTERFACES if path.suffix == ".msg"}
    types = {re.sub(r"\[.*", "", line.split()[0]) for part in parts(Path(name)) for line in part}
    return max((1 + depth(f"msg/{each}.msg") for each in types & own), default=0)


def place(name: str) -> tuple[int, int, str]:
    kind = ("msg", "srv", "action").index(name.partition("/")[0])
    return kind, 0 if kind else depth(name), name


def test_cmake_makes_each_of_them() -> None:
    listed = re.findall(r"^  ((?:msg|srv|action)/\S+)$", (PACKAGE / "CMakeLists.txt").read_text(), re.MULTILINE)
    assert listed == sorted(listed, key=place)
    assert {Path(name) for name in listed} == set(INTERFACES)


def test_the_package_names_what_it_uses_and_the_version_of_ual() -> None:
    manifest = ET.parse(PACKAGE / "package.xml").getroot()
    text = "".join((PACKAGE / path).read_text() for path in INTERFACES)
    used = set(re.findall(r"^(\w+)/", text, re.MULTILINE)) - {"ual_msgs"}
    assert {each.text for each in manifest.findall("depend")} == used | {"action_msgs"}
    assert manifest.findtext("version") == ual.__version__
    assert manifest.findtext("license") == "Apache-2.0"


@pytest.mark.parametrize("path", ANSWERS, ids=str)
def test_each_answer_has_what_an_error_of_ual_has(path: Path) -> None:
    assert parts(path)[1][: len(OUTCOME)] == OUTCOME


def test_the_numbers_of_a_state_are_those_of_ual_for_ros_1() -> None:
    assert list(numbers("msg/State.msg")) == [state.name for state in State]
    assert list(numbers("msg/State.msg").values()) == list(range(7))


@pytest.mark.parametrize(
    ("path", "meant"),
    [
        ("srv/GoToWaypointGeo.srv", AltitudeReference),
        ("action/GoToWaypointGeo.action", AltitudeReference),
        ("action/FollowPath.action", PathHeading),
        ("msg/GeoWaypoint.msg", AltitudeReference),
    ],
)
def test_the_other_numbers_are_those_of_the_contract(path: str, meant: type[AltitudeReference | PathHeading]) -> None:
    text = (ROOT / "proto" / "ual" / "v1" / "ual.proto").read_text(encoding="utf-8")
    prefix = re.sub(r"(?<!^)(?=[A-Z])", "_", meant.__name__).upper()
    of_contract = {name: int(number) for name, number in re.findall(rf"^  {prefix}_(\w+) = (\d+);", text, re.MULTILINE)}
    assert numbers(path) == {member.name: of_contract[member.name] for member in meant}
