"""`ual_msgs` names what it uses, and the numbers of states are those of UAL for ROS 1."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree as ET

import ual
from ual.types import State

PACKAGE = Path(__file__).parents[3] / "clients" / "ros2" / "ual_msgs"


def test_the_package_names_what_it_uses_and_the_version_of_ual() -> None:
    manifest = ET.parse(PACKAGE / "package.xml").getroot()
    text = "".join(path.read_text() for kind in ("msg", "srv", "action") for path in (PACKAGE / kind).iterdir())
    used = set(re.findall(r"^(\w+)/", text, re.MULTILINE)) - {"ual_msgs"}
    assert {each.text for each in manifest.findall("depend")} == used | {"action_msgs"}
    assert manifest.findtext("version") == ual.__version__.partition(".dev")[0], "ROS knows no development releases"
    assert manifest.findtext("license") == "Apache-2.0"


def test_the_numbers_of_a_state_are_those_of_ual_for_ros_1() -> None:
    text = (PACKAGE / "msg" / "State.msg").read_text(encoding="utf-8")
    numbers = re.findall(r"^uint8 ([A-Z_]+) = (\d+)", text, re.MULTILINE)
    assert numbers == [(state.name, str(number)) for number, state in enumerate(State)]
