"""Files of parameters in the forms of others, and what differs between a file and a UAV."""

from __future__ import annotations

import re
import string
import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual.errors import InvalidArgumentError
from ual.parameters import Difference, OtherComponent, Parameter, ParameterType, compare, read, write
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
        ("# a comment\nMPC_XY_P,0,95\n", r"line 2: expected a name and a value, got 'MPC_XY_P,0,95' \(a comma"),
        ("WPNAV_SPEED,1,000\n", r"line 1: .*'WPNAV_SPEED,1,000' \(a comma"),
        ("X 0,95\n", r"line 1: .*'X 0,95' \(a comma"),
        ("X\t0,95\n", r"line 1: .* \(a comma"),
        ("X;0.95\n", r"line 1: expected a name and a value"),
        ("X,0.95;m\n", r"line 1: X: '0.95;m' is no number"),
        ("X,0.95 m\n", r"line 1: X: '0.95 m' is no number"),
        ("X 1 ; slow\n", r"line 1: expected a name and a value"),
        ("X 1 @READONLY\n", r"line 1: expected a name and a value"),
        ("X = 1\n", r"line 1: expected a name and a value"),
        ('"X","1"\n', r"line 1: '\"X\"' is no name"),
        ("X,0x10\n", r"line 1: X: '0x10' is no number"),
        ("X,1_000\n", r"line 1: X: '1_000' is no number"),
        ("X,1\u00a0000\n", r"line 1: X: .* is no number"),
        ("X,\u0661\n", r"line 1: X: .* is no number"),
        ("X,infinity\n", r"line 1: X: 'infinity' is no number"),
        ("X,1e999\n", r"line 1: X: '1e999' is no number"),
        ("X,\n", r"line 1: X: '' is no number"),
        ("0,95\n", r"line 1: '0' is no name"),
        ("", r"it has no parameters of an autopilot$"),
        ("# only comments\n", r"it has no parameters of an autopilot$"),
        ("XY\x00,1", r"is not a text file"),
        ('{"fileType": "Plan"}', r"line 1: .* is no name of a parameter"),
        ("QGC WPL 110\n", r"line 1: expected a name and a value"),
        ("1\t1\tX\t0,95\t9\n", r"line 1: expected a name and a value, got .* \(a comma"),
        ("1,1,X,0.95,9\n", r"line 1: expected a name and a value"),
        ("1\t1\tX\t0.95\n", r"line 1: expected a name and a value"),
        ("1\t1\tX\t0.95\t9\t0\n", r"line 1: expected a name and a value"),
        ("256\t1\tX\t1\t9\n", r"line 1: '256' is no system"),
        ("1\t-1\tX\t1\t9\n", r"line 1: '-1' is no component"),
        ("1\t1\tX\t1\t0\n", r"line 1: X: '0' is no type"),
        ("1\t1\tX\t1\t8\n", r"line 1: X: '8' is no type"),
        ("1\t1\tX\t3.5\t6\n", r"line 1: X: 3.5 is no value of the type INT32"),
        ("1\t1\tX\tnan\t6\n", r"line 1: X: nan is no value of the type INT32"),
        ("1\t1\tX\t300\t1\n", r"line 1: X: 300 is no value of the type UINT8"),
        ("1\t1\tX\t1e39\t9\n", r"line 1: X: 1e39 is no value of the type REAL32"),
        ("1\t1\tX\t1\t9\n2\t1\tY\t1\t9\n", r"line 2: it is of system 2, and lines before of system 1"),
        ("1\t100\tX\t1\t9\n", r"no parameters of an autopilot: it has 1 line of component 100 \(X\)$"),
        ("1\t1\tX\t1\t9\n1\t1\tX\t2\t9\n", r"line 2: X was 1 before, and is 2 here"),
    ],
)
def test_a_wrong_row_is_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "a.param"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InvalidArgumentError, match=message):
        read(path)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-32", "latin-1", "cp1252"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("text", [QGC, MISSION_PLANNER, MAVPROXY])
def test_each_encoding_and_end_of_row_has_the_same_values(tmp_path: Path, text: str, end: str, encoding: str) -> None:
    path = tmp_path / "a.param"
    path.write_bytes(f"{text}# Höhe\n".replace("\n", end).encode(encoding))
    assert compare(read(path), PARAMETERS, all_names=True) == []


def test_rows_of_other_components_are_left_out_and_named(tmp_path: Path) -> None:
    path = tmp_path / "two.params"
    path.write_text(f"{QGC}1\t154\tCAL_ID\t7\t6\n1\t154\tMPC_XY_CRUISE\t3.0\t9\n1\t100\tCAM_MODE\t2\t8\n")
    found = read(path)
    assert compare(found, PARAMETERS, all_names=True) == []
    assert found.left_out == (OtherComponent(100, ("CAM_MODE",)), OtherComponent(154, ("CAL_ID", "MPC_XY_CRUISE")))
    assert [each.text for each in found.left_out] == [
        "1 line of component 100 (CAM_MODE)",
        "2 lines of component 154 (CAL_ID, MPC_XY_CRUISE)",
    ]


LINES = [("MPC_XY_CRUISE", "5.1"), ("COM_RC_IN_MODE", "3"), ("BAT_LOW_THR", "-0.15")]
FORMS = {
    "QGroundControl": "\n".join(f"1\t1\t{name}\t{value}\t{6 if '.' not in value else 9}" for name, value in LINES),
    "Mission Planner": "\n".join(",".join(each) for each in LINES),
    "MAVProxy": "\n".join(" ".join(each) for each in LINES),
}
SIGNS = string.punctuation + string.whitespace + "\x00\xa0\u0661"


@pytest.mark.parametrize("text", FORMS.values(), ids=FORMS.keys())
@given(st.data())
def test_a_sign_too_many_or_instead_gives_the_same_values_or_a_refusal(text: str, data: st.DataObject) -> None:
    """No digit and no letter is changed: what is read otherwise then was never written."""
    at = data.draw(st.integers(0, len(text) - 1).filter(lambda i: not text[i].isalnum()))
    sign = data.draw(st.sampled_from(SIGNS).filter(lambda each: each not in "_-+.#"))
    changed = text[:at] + sign + text[at + data.draw(st.sampled_from((0, 1))) :]
    wanted = {name: float(value) for name, value in LINES}
    found: dict[str, float]
    with tempfile.NamedTemporaryFile() as file:
        file.write(changed.encode())
        file.flush()
        try:
            found, refusal = read(Path(file.name)), ""
        except InvalidArgumentError as error:
            found, refusal = {}, error.message
    if refusal:
        assert re.search(r", line \d+: |is not a text file", refusal)
    else:
        assert {name: abs(value) for name, value in found.items()} == {n: abs(v) for n, v in wanted.items()}


@pytest.mark.parametrize("text", FORMS.values(), ids=FORMS.keys())
@pytest.mark.parametrize("line", range(3))
def test_a_column_that_is_missing_or_doubled_is_refused_with_its_row(tmp_path: Path, text: str, line: int) -> None:
    lines = text.split("\n")
    [separator] = {each for each in lines[line] if each in "\t, "}
    fields = lines[line].split(separator)
    for column in range(len(fields)):
        for put in ([], [fields[column]] * 2):
            changed = [*lines]
            changed[line] = separator.join([*fields[:column], *put, *fields[column + 1 :]])
            path = tmp_path / "a.param"
            path.write_text("\n".join(changed))
            with pytest.raises(InvalidArgumentError, match=f", line {line + 1}: "):
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
