"""Files of parameters in the forms of others, and what differs between a file and a UAV."""

from __future__ import annotations

from pathlib import Path

import pytest

from ual.errors import InvalidArgumentError
from ual.parameters import Difference, Parameter, ParameterType, compare, read, write
from ual.parameters.values import real32

PARAMETERS = [
    Parameter("MPC_XY_CRUISE", real32(5.1), ParameterType.REAL32),
    Parameter("COM_RC_IN_MODE", 3, ParameterType.INT32),
    Parameter("BAT_LOW_THR", real32(0.15), ParameterType.REAL32),
]
QGC = (
    "# Onboard parameters for Vehicle 1\n#\n# Stack: PX4 Pro\n# Vehicle: Multi-Rotor\n# Version: 1.17.0 \n"
    "# Vehicle-Id Component-Id Name Value Type\n"
    "1\t1\tBAT_LOW_THR\t0.150000005960464478\t9\n"
    "1\t1\tCOM_RC_IN_MODE\t3\t6\n"
    "1\t1\tMPC_XY_CRUISE\t5.099999904632568359\t9\n"
)
"""As QGroundControl 4.4 saves them."""
MISSION_PLANNER = "#NOTE: 11/25/2026 Copter\nBAT_LOW_THR,0.15\nCOM_RC_IN_MODE,3\nMPC_XY_CRUISE,5.1\n"
MAVPROXY = "# a comment\n\nBAT_LOW_THR      0.150000\nCOM_RC_IN_MODE   3\nMPC_XY_CRUISE    5.100000 # cruise\n"


@pytest.mark.parametrize("text", [QGC, MISSION_PLANNER, MAVPROXY, QGC.replace("\n", "\r\n")])
def test_the_files_of_others_are_read_and_are_alike(tmp_path: Path, text: str) -> None:
    path = tmp_path / "file"
    path.write_bytes(text.encode())
    assert compare(read(path), PARAMETERS, all_names=True) == []


@pytest.mark.parametrize("name", ["a.params", "a.param", "a.parm", "a.PARAMS"])
def test_what_is_written_is_read_again_exactly(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    assert write(PARAMETERS, path) == 3
    assert compare(read(path), PARAMETERS, all_names=True) == []


def test_the_forms_are_those_of_the_programs(tmp_path: Path) -> None:
    qgc, mission_planner = tmp_path / "a.params", tmp_path / "a.param"
    write(PARAMETERS, qgc)
    assert qgc.read_text().splitlines()[-3:] == [
        "1\t1\tBAT_LOW_THR\t0.15\t9",
        "1\t1\tCOM_RC_IN_MODE\t3\t6",
        "1\t1\tMPC_XY_CRUISE\t5.1\t9",
    ]
    write(PARAMETERS, mission_planner)
    assert mission_planner.read_text() == "BAT_LOW_THR,0.15\nCOM_RC_IN_MODE,3\nMPC_XY_CRUISE,5.1\n"


def test_a_value_that_is_not_a_number_is_the_same_again(tmp_path: Path) -> None:
    parameters = [Parameter("X", float("nan"), ParameterType.REAL32)]
    write(parameters, tmp_path / "a.params")
    assert compare(read(tmp_path / "a.params"), parameters) == []
    assert [each.name for each in compare({"X": 1.0}, parameters)] == ["X"]


def test_another_ending_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidArgumentError, match=r"must end in \.params, \.param, \.parm"):
        write(PARAMETERS, tmp_path / "a.txt")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("X,1\nY\n", r"line 2: expected a name and a value, got 'Y'"),
        ("X,one", r"line 1: X: 'one' is no number"),
        ("A-B,1", r"line 1: 'A-B' is no name"),
        ("A_NAME_OF_17_CHARS,1", r"is no name"),
        ("X,1\nX,2", r"line 2: X was 1 before, and is 2 here"),
    ],
)
def test_a_wrong_line_is_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "a.param"
    path.write_text(text)
    with pytest.raises(InvalidArgumentError, match=message):
        read(path)


def test_a_file_that_is_a_part_differs_only_where_it_says_something() -> None:
    cruise, mode, low = PARAMETERS
    in_file = {"MPC_XY_CRUISE": 6.0, "COM_RC_IN_MODE": 3.0, "NOT_THERE": 1.0}
    assert compare(in_file, PARAMETERS) == [
        Difference("MPC_XY_CRUISE", 6.0, cruise),
        Difference("NOT_THERE", 1.0, None),
    ]
    assert compare({mode.name: 3.0, cruise.name: 5.1}, PARAMETERS, all_names=True) == [
        Difference("BAT_LOW_THR", None, low)
    ]


def test_names_of_a_crazyflie_are_written_and_read(tmp_path: Path) -> None:
    parameters = [Parameter("posCtlPid.xVelMax", real32(0.75), ParameterType.REAL32)]
    path = tmp_path / "a.param"
    assert write(parameters, path) == 1
    assert read(path) == {"posCtlPid.xVelMax": pytest.approx(0.75)}
    assert compare(read(path), parameters, all_names=True) == []
