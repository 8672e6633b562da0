"""Knowledge of `team.launch.py` about a team: its UAVs, and what rviz2 shows of them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from ual_ros2 import team
from ual_tools.view.models import MODELS

PACKAGE = Path(__file__).parents[3] / "clients" / "ros2" / "ual_ros2"
TEMPLATE = (PACKAGE / "rviz" / "uav.rviz").read_text(encoding="utf-8")
UAL = str(Path(sys.executable).with_name("ual"))


def displays(text: str) -> dict[str, dict[str, Any]]:
    """The displays of a configuration, by their names."""
    return {each["Name"]: each for each in yaml.safe_load(text)["Visualization Manager"]["Displays"]}


def test_the_names_are_those_of_the_file(tmp_path: Path) -> None:
    file = tmp_path / "team.yaml"
    file.write_text("uavs: [{count: 2}, {ns: boat}]\nafter: [{name: mission, run: [ual, --all, takeoff, '3']}]\n")
    assert team.names(UAL, str(file)) == ["uav_1", "uav_2", "boat"]


def test_a_wrong_file_is_reported_in_the_words_of_ual(tmp_path: Path) -> None:
    file = tmp_path / "team.yaml"
    file.write_text("uavs: [{bakend: light}]\n")
    with pytest.raises(RuntimeError, match=r"team.yaml:1: uavs\[0\].bakend: there is no such key"):
        team.names(UAL, str(file))


def test_a_missing_command_is_reported_with_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match=r"`ual` does not run. Activate .* or name it \(ual:=.*: .*/nowhere/ual"):
        team.names("/nowhere/ual", str(tmp_path / "team.yaml"))


def test_what_a_shell_leaves_as_it_is_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/me")
    assert team.path("~/env/bin/ual") == "/home/me/env/bin/ual"
    assert team.path("ual") == "ual"
    assert team.rate_hz("50") == 50.0
    with pytest.raises(RuntimeError, match="rate_hz: 'fast' is not a number"):
        team.rate_hz("fast")


def test_rviz_shows_each_uav_with_its_model() -> None:
    shown = displays(team.rviz(TEMPLATE, ["uav_1", "boat"], "/share/a model.urdf"))
    assert list(shown) == ["Ground", "Frames", "uav_1", "boat"]
    assert "uav_1" not in str(shown["boat"])
    model, track, reference, way = shown["boat"]["Displays"]
    assert (model["TF Prefix"], model["Description File"]) == ("boat", "/share/a model.urdf")
    assert track["Topic"]["Value"] == "/boat/ual/odom"
    assert reference["Topic"]["Value"] == "/boat/ual/ref_pose"
    assert way["Topic"] == {"Value": "/boat/ual/route", "Durability Policy": "Transient Local"}


def test_the_template_itself_shows_uav_1() -> None:
    assert list(displays(TEMPLATE)) == ["Ground", "Frames", "uav_1"]


def test_each_model_of_the_viewer_can_be_chosen() -> None:
    assert tuple(MODELS) == team.MODELS
    assert {f"{name}.urdf" for name in MODELS} == {path.name for path in (PACKAGE / "urdf").glob("*.urdf")}
