"""The ``ual`` command: in the process with click's runner, and as a program where signals and terminals matter."""

from __future__ import annotations

import json
import math
import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import pytest
from click.shell_completion import ShellComplete
from click.testing import CliRunner, Result

import ual
from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon
from tests.forkserver import run_ual
from tests.pages import why_wrong
from tests.ports import free_port
from tests.ual import fake_daemon
from tests.ual_tools.terminal import UAL, Terminal
from tests.waiting import until_state
from ual.discovery import Registration
from ual.types import State, Telemetry
from ual_tools import values
from ual_tools.app import SHARED_OPTIONS, UalCommand, UalGroup
from ual_tools.help import Section
from ual_tools.main import cli
from ual_tools.watch_board import Board


@pytest.fixture(autouse=True)
def nothing_from_outside(monkeypatch: pytest.MonkeyPatch, runtime_dir: Path) -> None:
    del runtime_dir
    for name in ("UAL_NS", "UAL_ADDRESS", "UAL_TLS_CA"):
        monkeypatch.delenv(name, raising=False)
    # A shell lets what it starts in the background ignore SIGINT; our programs would inherit that.
    signal.signal(signal.SIGINT, signal.default_int_handler)


def run(*words: str | Path, stdin: str | None = None) -> Result:
    return CliRunner().invoke(cli, [str(word) for word in words], input=stdin)


def done(*words: str | Path, stdin: str | None = None) -> str:
    """Returns the output of a command that must succeed."""
    result = run(*words, stdin=stdin)
    assert result.exit_code == 0, result.output
    return result.stdout


def done_json(*words: str | Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in done("--json", *words).splitlines()]


def wait_for_state(*states: State) -> None:
    with ual.Uav() as uav:
        until_state(uav, *states)


@pytest.fixture
def flying(daemon: DaemonProcess) -> DaemonProcess:
    """A daemon whose UAV flies at 3 m."""
    wait_for_state(State.LANDED_ARMED)
    done("takeoff", "3")
    return daemon


# --- Usage ------------------------------------------------------------------------------------------------------------


def every_command(group: click.Group = cli, name: str = "ual") -> list[tuple[str, click.Command]]:
    found: list[tuple[str, click.Command]] = []
    for command in group.commands.values():
        found.append((f"{name} {command.name}", command))
        if isinstance(command, click.Group):
            found += every_command(command, f"{name} {command.name}")
    return found


@pytest.mark.parametrize(("name", "command"), every_command(), ids=[name for name, _ in every_command()])
def test_every_command_is_documented_and_takes_the_shared_options(name: str, command: click.Command) -> None:
    assert isinstance(command, (UalCommand, UalGroup))
    assert command.help
    text = done(*name.split()[1:], "--help")
    for option in ("--ns", "--address", "--json", "--timeout"):
        assert option in text


@pytest.mark.parametrize(("name", "command"), every_command(), ids=[name for name, _ in every_command()])
def test_the_help_of_every_command_has_an_example_that_is_accepted(name: str, command: click.Command) -> None:
    assert isinstance(command, (UalCommand, UalGroup))
    assert command.examples
    text = done(*name.split()[1:], "--help")
    for example in command.examples:
        assert f"  {example}\n" in text
        assert name.rsplit(maxsplit=1)[-1] in example
        if example.startswith("ual "):
            assert why_wrong(shlex.join(shlex.split(example.partition(" | ")[0], comments=True))) is None


def test_the_help_lists_commands_in_sections_and_each_once() -> None:
    text = done("--help")
    headings = re.findall(r"^(\S.*):$", text, re.MULTILINE)
    assert headings == ["Options", *(section.value for section in Section), "Examples"]
    for name in cli.commands:
        assert len(re.findall(rf"^  {name}  ", text, re.MULTILINE)) == 1


def groups(group: click.Group, *words: str) -> Iterator[tuple[str, ...]]:
    """The words of each group of commands, that of `ual` itself first."""
    yield words
    for name, each in group.commands.items():
        if isinstance(each, click.Group):
            yield from groups(each, *words, name)


@pytest.mark.parametrize("words", list(groups(cli)), ids=" ".join)
def test_a_terminal_of_80_columns_shows_what_each_command_does_to_the_end(words: tuple[str, ...]) -> None:
    shown = CliRunner().invoke(cli, [*words, "--help"], terminal_width=80).output
    assert "Options:" in shown
    assert [line for line in shown.splitlines() if re.fullmatch("  .*[.]{3}", line)] == []


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["takeoff", "3m"], "'3m' is not a number: write it without a unit"),
        (["velocity", "1", "0", "0", "--for", "1s"], "'1s' is not a number: write it without a unit"),
        (["goto", "4,2,3"], "'4,2,3' is not a number: write spaces between numbers"),
        (["goto", "1", "2", "high"], "'high' is not a number."),
        (["velocity", "1", "0", "0", "--for", "-1"], "-1.0 is not in the range"),
    ],
)
def test_a_word_that_is_no_number_is_answered_with_how_to_write_it(words: list[str], why: str) -> None:
    result = run(*words)
    assert result.exit_code == 2
    assert why in " ".join(result.stderr.split())


def test_only_the_help_of_ual_describes_the_shared_options() -> None:
    assert "Certificates to trust" in done("--help")
    for words in (["goto"], ["sim"], ["sim", "fault", "begin", "link-lost"]):
        text = done(*words, "--help")
        assert "Certificates to trust" not in text
        assert SHARED_OPTIONS in " ".join(text.split())


@pytest.mark.parametrize(("columns", "longest"), [(60, 60), (80, 80), (110, 110), (300, 120)])
def test_the_help_uses_the_width_of_the_terminal(columns: int, longest: int) -> None:
    shown = run_ual(("path", "--help"), os.environ | {"COLUMNS": str(columns)})
    widths = [len(line) for line in shown.stdout.partition("Example")[0].splitlines()]
    assert longest - 15 <= max(widths) <= longest


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["gotoo", "1", "2", "3"], "Did you mean goto or goto-geo?"),
        (["take_off", "3"], "Did you mean takeoff?"),
        (["stop"], "Did you mean abort?"),
        (["sim", "takeover"], "Did you mean take-over?"),
        (["goto", "1", "2", "3", "--max_speed", "1"], "'--max-speed'"),
        (["frames", "ad"], "Did you mean add?"),
    ],
)
def test_a_mistyped_word_is_answered_with_what_was_meant(words: list[str], meant: str) -> None:
    result = run(*words)
    assert result.exit_code == 2
    assert meant in result.stderr


def test_simulation_is_another_name_of_sim(daemon: DaemonProcess) -> None:
    del daemon
    assert done("simulation", "fault", "list") == ""
    assert "take-over" in done("simulation", "--help")


def test_messages_name_a_command_as_it_is_typed(daemon: DaemonProcess) -> None:
    wait_for_state(State.LANDED_ARMED)
    for words in (["goto", "1", "2", "3"], ["path", "1,2,3"], ["recover"], ["pose", "1", "2", "3"]):
        refused = run(*words, "--ns", daemon.ns)
        assert refused.stderr.startswith(f"ual: WRONG_STATE: {words[0]} needs the state ")


def imported_by(code: str) -> set[str]:
    """Returns the names of the modules that a new Python has imported after this code."""
    command = [sys.executable, "-c", f"{code}; import sys; print(*sys.modules, file=sys.stderr)"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=LIMIT_S)
    return set(done.stderr.split())


def test_help_needs_no_grpc() -> None:
    assert not {"grpc", "rich"} & imported_by("from ual_tools.main import cli; list(cli.commands.values())")


def test_a_command_imports_what_it_needs_alone() -> None:
    assert not {"ual_tools.flight", "ual_tools.missions"} & imported_by("import ual_tools.main")
    needed = imported_by("from ual_tools.main import cli; cli.commands['land']")
    assert "ual_tools.flight" in needed
    assert not {"ual_tools.missions", "ual_tools.cameras", "ual_tools.certificates"} & needed


@pytest.mark.parametrize(
    "words",
    [
        ["goto", "1", "2"],
        ["goto", "1", "2", "three"],
        ["goto", "1", "2", "3", "--yaw", "north"],
        ["goto", "1", "2", "3", "--yaww", "1"],
        ["nonsense"],
        ["path"],
        ["path", "1,2"],
        ["path", "1,2,3,4,5"],
        ["path", "1,2,3", "--heading", "north"],
        ["path", "1,2,3", "--speeds", "1,fast"],
        ["goto", "1", "2", "3", "--max-speed", "fast"],
        ["velocity", "1", "0", "0"],
        ["velocity", "1", "0", "0", "--for", "nan"],
        ["takeoff", "3", "--timeout", "0"],
        ["takeoff", "3", "--timeout", "nan"],
        ["watch", "--rate", "nan"],
        ["watch", "--all", "--rate", "inf"],
        ["goto-geo", "1", "2", "3", "--reference", "moon"],
        ["goto", "1_000", "2", "3"],
        ["goto", "infinity", "2", "3"],
        ["goto", "１", "2", "3"],
        ["goto", "0x10", "2", "3"],
        ["goto", "1", "2", "3", "--yaw", "9_0deg"],
        ["path", "1_0,2,3"],
        ["path", "1,2,3", "--speeds", "1_0"],
        ["path", "1,2,3", "--heading", "nan,0,0"],
        ["path", "1,2,3", "--altitude", "20"],
        ["path", "1,2,3", "--reference", "amsl"],
        ["path", "--file", "r.gpx", "--reference", "sea"],
        ["land", "--at", "+1_0"],
        ["token", "new", "me", "--days", "1_0"],
        ["check", "--only", "no_such_check"],
        ["sim", "fault", "begin", "estimator-jumps", "--offset", "1"],
        ["state", "--tls-ca", "/no/such/file"],
        ["completion", "tcsh"],
    ],
    ids=" ".join,
)
def test_wrong_usage_is_reported_with_status_2(words: list[str]) -> None:
    result = run(*words)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert "Error: " in result.stderr


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_prints_the_script_of_a_shell(shell: str) -> None:
    assert "_UAL_COMPLETE" in done("completion", shell)


def completed(*words: str) -> list[str]:
    """Returns the completions of click after some words, of which the last one is incomplete."""
    *given, incomplete = words
    found = ShellComplete(cli, {}, "ual", "_UAL_COMPLETE").get_completions(given, incomplete)
    return [each.value for each in found]


def test_names_of_frames_are_completed(daemon: DaemonProcess) -> None:
    del daemon
    done("frames", "add", "pad", "1", "2", "0")
    names = ["map", "uav_1/odom", "uav_1/base_link", "uav_1/gimbal_0", "pad"]
    for words in (["goto", "1", "2", "3", "--frame"], ["velocity", "--frame"], ["waypoints", "save", "--frame"]):
        assert completed(*words, "") == names
    assert completed("--ns", "uav_1", "pose", "--frame", "uav_1/b") == ["uav_1/base_link"]
    assert completed("frames", "remove", "p") == ["pad"]
    assert completed("frames", "add", "--parent", "m") == ["map"]


def test_faults_checks_and_states_are_completed(daemon: DaemonProcess) -> None:
    del daemon
    fault = done("sim", "fault", "begin", "battery-low").strip()
    assert completed("sim", "fault", "end", "") == [fault]
    assert "takes_off" in completed("check", "--only", "t")
    assert completed("wait", "landed") == ["landed_disarmed", "landed_armed"]


@pytest.mark.parametrize("words", [["--address", "nonsense"], ["--address", "127.0.0.1:1"], ["--ns", "uav_4"]])
def test_without_a_daemon_nothing_is_completed_and_nothing_reported(
    words: list[str], capfd: pytest.CaptureFixture[str]
) -> None:
    assert completed(*words, "goto", "--frame", "") == []
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("shell", "environment", "expected"),
    [
        ("bash", {"COMP_WORDS": "ual take", "COMP_CWORD": "1"}, "plain,takeoff"),
        ("zsh", {"COMP_WORDS": "ual take", "COMP_CWORD": "1"}, "plain\ntakeoff\n"),
        ("fish", {"COMP_WORDS": "ual take", "COMP_CWORD": "take"}, "plain"),
    ],
)
def test_each_shell_gets_its_completions(shell: str, environment: dict[str, str], expected: str) -> None:
    asked = os.environ | {"_UAL_COMPLETE": f"{shell}_complete"} | environment
    result = run_ual((), asked)
    assert result.stdout.startswith(expected)
    assert "takeoff" in result.stdout


def test_namespaces_are_completed(daemon: DaemonProcess) -> None:
    environment = os.environ | {"_UAL_COMPLETE": "bash_complete", "COMP_WORDS": "ual --ns u", "COMP_CWORD": "2"}
    result = run_ual((), environment)
    assert result.stdout.split(",")[-1].strip() == daemon.ns


# --- Without a daemon -------------------------------------------------------------------------------------------------


def test_without_a_daemon_the_reason_is_one_message() -> None:
    result = run("--ns", "uav_4", "takeoff", "3")
    assert result.exit_code == 1
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith("ual: DAEMON_UNREACHABLE: ")
    for part in ("uav_4", "127.0.0.1:50054", "ual-daemon --ns uav_4"):
        assert part in line


@pytest.mark.parametrize(
    ("words", "environment", "ns"),
    [
        (["--ns", "uav_4", "state"], None, "uav_4"),
        (["state", "--ns", "uav_5"], None, "uav_5"),
        (["--ns", "uav_4", "state", "--ns", "uav_5"], None, "uav_5"),
        (["state"], "uav_6", "uav_6"),
        (["--ns", "uav_4", "state"], "uav_6", "uav_4"),
        (["--ns", "uav_4", "sim", "fault", "list"], "uav_6", "uav_4"),
    ],
)
def test_the_option_nearest_to_the_command_says_which_uav(
    words: list[str], environment: str | None, ns: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if environment is not None:
        monkeypatch.setenv("UAL_NS", environment)
    assert f"no UAL daemon of {ns} answers" in run(*words).stderr


def test_as_json_a_failure_is_an_object_too() -> None:
    result = run("state", "--json", "--address", "127.0.0.1:1")
    assert result.exit_code == 1
    error = json.loads(result.stdout)["error"]
    assert error["reason"] == "DAEMON_UNREACHABLE"
    assert error["metadata"]["address"] == "127.0.0.1:1"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["goto", "1", "2", "--json"], "Missing argument"),
        (["--json", "goto", "1", "2", "3", "--yaww", "1"], "--yaww"),
        (["--json", "--nonsense"], "--nonsense"),
        (["nonsense", "--json"], "nonsense"),
        (["mission", "start", "--from", "0", "--json"], "--from"),
        (["--all", "--ns", "uav_1", "--json", "land"], "--all"),
    ],
    ids=" ".join,
)
def test_as_json_wrong_usage_is_one_object_too(words: list[str], told: str) -> None:
    result = run(*words)
    assert result.exit_code == 2
    error = json.loads(result.stdout)["error"]
    assert error["reason"] == "INVALID_ARGUMENT"
    assert told in error["message"]
    assert "Error: " in result.stderr


def test_nobody_is_listed_when_nobody_is_there() -> None:
    assert done("list") == ""


@pytest.mark.parametrize("words", [["watch", "--all"], ["watch", "--all", "--once"]], ids=" ".join)
def test_nobody_is_watched_when_nobody_is_there(words: list[str]) -> None:
    result = run(*words)
    assert (result.exit_code, result.stdout) == (1, "")
    assert "no daemon runs on this computer" in result.stderr


def test_one_that_registered_nonsense_is_listed_as_that(runtime_dir: Path) -> None:
    runtime_dir.mkdir()
    Registration("uav_1", os.getpid(), "nonsense", "light", 1.5).write()
    assert done("list").split("\t")[:2] == ["uav_1", "INVALID_ARGUMENT"]


# --- Looking ----------------------------------------------------------------------------------------------------------


def test_list_shows_every_daemon_of_this_computer(start_daemon: StartDaemon) -> None:
    daemons = [start_daemon(ns=ns) for ns in ("uav_2", "uav_1")]
    for each in daemons:
        each.wait_for("listening")
    rows = [line.split("\t") for line in done("list").splitlines()]
    assert [row[0] for row in rows] == ["uav_1", "uav_2"]
    found = done_json("list")
    assert [each["ns"] for each in found] == ["uav_1", "uav_2"]
    assert {each["pid"] for each in found} == {each.pid for each in daemons}
    assert all(each["state"] == "LANDED_DISARMED" for each in found)
    result = run("state")
    assert result.exit_code == 1
    assert "several UAVs run on this computer, choose one: uav_1, uav_2" in result.stderr


def test_what_a_uav_is_and_does(daemon: DaemonProcess) -> None:
    assert "light" in done("info")
    (info,) = done_json("info")
    assert info["ns"] == info["namespace"] == daemon.ns
    assert "TAKE_OFF" in info["capabilities"]
    assert done("state").strip() in State.__members__
    (state,) = done_json("state", "--ns", "uav_1")
    assert state["ns"] == "uav_1"
    (sample,) = done_json("watch", "--once")
    assert sample["ns"] == "uav_1"
    assert sample["pose"]["position"]["z"] == pytest.approx(0.0, abs=0.5)
    assert done("watch", "--all", "--once").startswith("uav_1\t")


def test_frames_are_listed_added_and_removed(daemon: DaemonProcess) -> None:
    del daemon
    done("frames", "add", "pad", "1", "-2", "0.5", "--yaw", "-90deg")
    frames = {frame["frame_id"]: frame for frame in done_json("frames")}
    assert frames["pad"]["parent_frame_id"] == "map"
    assert frames["pad"]["transform"]["translation"] == {"x": 1.0, "y": -2.0, "z": 0.5}
    assert "uav_1/base_link" in done("frames")
    assert done("frames", "remove", "pad") == "frame pad removed\n"
    assert "pad" not in {frame["frame_id"] for frame in done_json("frames")}
    result = run("frames", "remove", "pad")
    assert (result.exit_code, result.stderr.startswith("ual: UNKNOWN_FRAME: ")) == (1, True)
    result = run("frames", "add", "pad2", "0", "0", "0", "--parent", "nowhere")
    assert (result.exit_code, result.stderr.startswith("ual: UNKNOWN_FRAME: ")) == (1, True)


def test_watch_goes_on_in_a_pipe_until_it_is_interrupted(daemon: DaemonProcess) -> None:
    del daemon
    with subprocess.Popen([*UAL, "--json", "watch", "--rate", "20"], stdout=subprocess.PIPE, text=True) as watching:
        assert watching.stdout is not None
        samples = [json.loads(watching.stdout.readline()) for _ in range(3)]
        watching.send_signal(signal.SIGINT)
        assert watching.wait(LIMIT_S) == 130
    assert samples[0]["sequence"] < samples[1]["sequence"] < samples[2]["sequence"]


def test_watch_tells_one_that_does_not_answer_next_to_the_others(start_daemon: StartDaemon) -> None:
    start_daemon(ns="uav_2").wait_for("listening")
    Registration("uav_1", os.getpid(), "127.0.0.1:1", "light", 1.5).write()
    result = run("--json", "watch", "--all", "--once")
    assert result.exit_code == 1
    first, second = map(json.loads, result.stdout.splitlines())
    assert (first["ns"], first["error"]["reason"]) == ("uav_1", "DAEMON_UNREACHABLE")
    assert (second["ns"], second["state"]) == ("uav_2", "LANDED_DISARMED")
    assert result.stderr.startswith("ual: uav_1: DAEMON_UNREACHABLE: ")
    with subprocess.Popen([*UAL, "watch", "--all"], stdout=subprocess.PIPE, text=True) as watching:
        assert watching.stdout is not None
        assert watching.stdout.readline().startswith("uav_2\tLANDED_DISARMED")
        watching.send_signal(signal.SIGINT)
        assert watching.wait(LIMIT_S) == 130


def test_samples_that_were_not_printed_are_counted() -> None:
    board = Board(["uav_1", "uav_2"], 0.0)

    def put(ns: str, sequence: int, missed_count: int) -> None:
        board.put(ns, Telemetry(State.FLYING_AUTO, sequence=sequence, missed_count=missed_count))

    def taken() -> dict[str, tuple[int, int]]:
        return {ns: (each.sequence, each.missed_count) for ns, each in board.take().items()}

    put("uav_1", 4, 3)
    put("uav_2", 9, 0)
    put("uav_1", 5, 0)
    put("uav_1", 8, 2)
    assert taken() == {"uav_1": (8, 7), "uav_2": (9, 0)}
    assert taken() == {}
    put("uav_1", 9, 0)
    assert taken() == {"uav_1": (9, 0)}


def test_a_reader_that_has_enough_ends_watch_quietly(daemon: DaemonProcess) -> None:
    del daemon
    with subprocess.Popen(
        [*UAL, "--json", "watch", "--rate", "20"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as watching:
        assert watching.stdout is not None
        assert watching.stderr is not None
        watching.stdout.readline()
        watching.stdout.close()
        assert watching.wait(LIMIT_S) == 0
        assert watching.stderr.read() == ""


# --- Flying -----------------------------------------------------------------------------------------------------------


def test_the_flight_of_the_issue(start_daemon: StartDaemon, tmp_path: Path) -> None:
    start_daemon("--set", "light.speed_factor=10", ns="uav_2").wait_for("listening")
    us = ("--ns", "uav_2")
    assert run(*us, "takeoff", "3").exit_code == 1
    assert done(*us, "sim", "arm") == "armed by the pilot\n"
    assert done(*us, "takeoff", "3").startswith("TAKE_OFF SUCCEEDED after ")
    assert done(*us, "goto", "4", "2", "3", "--yaw", "90deg").startswith("GO_TO_WAYPOINT SUCCEEDED after ")
    with ual.Uav("uav_2") as uav:
        assert uav.pose().pose.yaw_rad == pytest.approx(1.5708, abs=0.1)
        assert done(*us, "velocity", "1", "0", "0", "--for", "0.5") == "flew for 0.5 s, stopped\n"
        assert uav.pose().pose.position.x > 4.1  # by how much depends on how fast a busy computer simulates
    refused = run(*us, "recover")
    assert refused.exit_code == 1
    assert refused.stderr.startswith("ual: WRONG_STATE: ")
    done(*us, "sim", "take-over")
    done(*us, "sim", "sticks", "--forward", "0.2")
    done(*us, "sim", "sticks")
    assert done(*us, "state") == "FLYING_MANUAL\n"
    assert done(*us, "recover") == "recovered\n"
    done(*us, "goto", "-1", "-2", "3")
    (task,) = done_json(*us, "path", "0,0,3", "2,0,3,90deg", "--corner-radius", "0.5")
    assert (task["kind"], task["status"]) == ("FOLLOW_PATH", "SUCCEEDED")
    file = tmp_path / "waypoints.jsonl"
    done(*us, "waypoints", "save", file)
    done(*us, "pose", "1", "1", "3")
    done(*us, "abort", "--freeze")
    done(*us, "waypoints", "save", file, "--frame", "map")
    assert done(*us, "waypoints", "fly", file).startswith("FOLLOW_PATH SUCCEEDED")
    assert done(*us, "path", "--file", "-", stdin="0,0,3 # home\n\n1,0,3,0.5rad\n").startswith("FOLLOW_PATH SUCCEEDED")
    assert done(*us, "land").startswith("LAND SUCCEEDED after ")
    done(*us, "home", "--set-z")
    done(*us, "sim", "disarm")
    done(*us, "arm")
    done(*us, "disarm")


def test_a_geographic_waypoint_is_approached(flying: DaemonProcess) -> None:
    del flying
    (sample,) = done_json("watch", "--once")
    here = sample["position_geo"]
    done("goto-geo", str(here["latitude_deg"] + 1e-5), str(here["longitude_deg"]), "4", "--yaw", "0")
    with ual.Uav() as uav:
        position = uav.pose().pose.position
    assert (position.x, position.y, position.z) == pytest.approx((0.0, 1.11, 4.0), abs=0.3)


def test_a_state_that_is_not_known_has_its_reason_on_stderr(start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--url", f"udpin://127.0.0.1:{free_port()}", backend="mavlink")
    daemon.wait_for("state", new="UNINITIALIZED")
    result = run("state")
    assert (result.exit_code, result.stdout) == (1, "UNINITIALIZED\n")
    assert result.stderr.startswith("ual: ")  # on a starved computer that this one did not run UAL comes first
    assert "nothing heard from the autopilot yet" in result.stderr


def test_wait_prints_the_state_that_came_and_fails_without_it(daemon: DaemonProcess) -> None:
    del daemon
    assert done("wait", "landed_armed", "FLYING_AUTO", "--timeout", str(LIMIT_S)) == "LANDED_ARMED\n"
    (found,) = done_json("wait", "LANDED_ARMED")
    assert found == {"ns": "uav_1", "state": "LANDED_ARMED"}
    late = run("wait", "LANDING", "--timeout", "0.01")
    assert late.exit_code == 1
    assert late.stderr.startswith("ual: TIMEOUT: the state is not LANDING after 0.01 s, but LANDED_ARMED")
    assert run("wait", "nowhere").exit_code == 2
    assert run("wait").exit_code == 2


def test_wait_waits_for_a_daemon_too(start_daemon: StartDaemon) -> None:
    with subprocess.Popen([*UAL, "--json", "wait", "landed_armed"], stdout=-1, stderr=-1, text=True) as waiting:
        assert waiting.stderr is not None
        assert "waits for a daemon" in waiting.stderr.readline()
        daemon = start_daemon("--auto-arm")
        try:
            output, _ = waiting.communicate(timeout=LIMIT_S)
        finally:
            waiting.kill()
    assert waiting.returncode == 0
    assert json.loads(output) == {"ns": daemon.ns, "state": "LANDED_ARMED"}


def test_wait_fails_where_no_daemon_comes_in_time() -> None:
    result = run("wait", "landed_armed", "--timeout", "0.3")
    assert result.exit_code == 1
    assert result.stderr.splitlines()[-1].startswith("ual: DAEMON_UNREACHABLE: ")


def test_each_state_has_its_reason_under_one_name(daemon: DaemonProcess) -> None:
    wait_for_state(State.LANDED_ARMED)  # its simulated safety pilot arms at any time before
    with ual.Uav(daemon.ns) as uav:
        reason = uav.telemetry().state_reason
    for words in (("state",), ("list",), ("watch", "--once")):
        [found] = done_json(*words)
        assert found["state_reason"] == reason
        assert found["ns"] == daemon.ns


def test_dry_runs_say_what_would_happen(daemon: DaemonProcess) -> None:
    del daemon
    wait_for_state(State.LANDED_ARMED)
    assert done("takeoff", "3", "--dry-run").startswith("would be accepted, 3.00 m, ")
    assert done("state") == "LANDED_ARMED\n"
    refused = run("land", "--dry-run")
    assert (refused.exit_code, refused.stderr.startswith("ual: WRONG_STATE: land needs ")) == (1, True)
    done("takeoff", "3")
    (plan,) = done_json("goto", "3", "4", "3", "--dry-run", "--max-speed", "0.5")
    assert plan["length_m"] == pytest.approx(5.0, abs=0.3)
    assert plan["duration_s"] > 9.0
    (plan,) = done_json("path", "3,4,3", "0,0,3", "--dry-run", "--max-speed", "0.5")
    assert plan["length_m"] == pytest.approx(10.0, abs=0.5)
    for words in (["land"], ["pose", "1", "1", "3"], ["velocity", "1", "0", "0", "--for", "1"]):
        assert done(*words, "--dry-run") == "would be accepted\n"
    (sample,) = done_json("watch", "--once")
    here = sample["position_geo"]
    assert done("goto-geo", str(here["latitude_deg"]), str(here["longitude_deg"]), "8", "--dry-run").startswith(
        "would "
    )
    for words in (
        ["recover"],
        ["takeoff", "3"],
        ["goto-geo", "91", "0", "3"],
        ["goto", "1", "0", "3", "--max-speed", "0"],
    ):
        assert run(*words, "--dry-run").exit_code == 1
    with ual.Uav() as uav:
        assert uav.is_idle()
        assert uav.pose().pose.position.x == pytest.approx(0.0, abs=0.2)


def test_a_waypoint_file_is_executed_dry(flying: DaemonProcess, tmp_path: Path) -> None:
    del flying
    file = tmp_path / "waypoints"
    file.write_text("3,0,3\n3,4,3\n")
    (plan,) = done_json("waypoints", "fly", file, "--dry-run", "--max-speed", "1", "--corner-radius", "0.5")
    assert 6.0 < plan["length_m"] < 7.1
    assert plan["duration_s"] > 6.0


def test_home_says_where_the_ground_is_where_its_height_is_not_set(start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--set", "light.start=[5, 2, -2.5]")
    us = ["--address", str(daemon.address)]
    said = done(*us, "home")
    assert "stands at z = -2.5 m in uav_1/odom, so that a go-to to z = 5 leads 7.5 m above this ground" in said
    (home,) = done_json(*us, "home")
    assert home["ground_z_m"] == -2.5
    assert done(*us, "home", "--set-z") == "home set\n"


def test_it_returns_home_and_takes_off_again_in_one_script(flying: DaemonProcess) -> None:
    done("goto", "3", "4", "3")
    (plan,) = done_json("rtl", "--height", "4", "--dry-run")
    assert plan["length_m"] == pytest.approx(6.0, abs=0.3)
    (plan,) = done_json("rtl", "--dry-run")
    assert plan["length_m"] == pytest.approx(12.0 + 5.0, abs=0.3)
    (task,) = done_json("rtl", "--height", "4")
    assert (task["kind"], task["status"]) == ("RETURN_TO_LAUNCH", "SUCCEEDED")
    for words in (["takeoff", "3"], ["land"], ["takeoff", "3"]):  # the daemon's simulated safety pilot arms in between
        done(*words)
    with ual.Uav() as uav:
        assert uav.state() is State.FLYING_AUTO
        assert uav.pose().pose.position.horizontal_norm() < 0.5
    assert flying.process.poll() is None


def test_a_task_is_paused_and_resumed(flying: DaemonProcess) -> None:
    assert run("pause").stderr == "ual: WRONG_STATE: pause: no task runs (see docs/reference/errors.md#wrong_state)\n"
    with ual.Uav() as uav:
        uav.simulation.set_speed_factor(0.1)  # the go-to lasts
        task = uav.go_to_waypoint(ual.Pose.at(5.0, 0.0, 3.0), blocking=False)
        assert done("pause").startswith("paused")
        (sample,) = done_json("watch", "--once")
        assert sample["task"]["is_paused"]
        assert done("resume") == "resumed\n"
        assert run("resume").exit_code == 1
        uav.simulation.set_speed_factor(10.0)
        task.wait(LIMIT_S)
    assert flying.process.poll() is None


def test_holds_are_executed(flying: DaemonProcess, tmp_path: Path) -> None:
    del flying
    file = tmp_path / "waypoints"
    file.write_text('{"x": 1, "y": 0, "z": 3, "hold_s": 30}\n0,0,3\n')
    (plan,) = done_json("waypoints", "fly", file, "--dry-run")
    assert plan["duration_s"] > 30.0
    (plan,) = done_json("path", "1,0,3", "0,0,3", "--holds", "0,40", "--dry-run")
    assert plan["duration_s"] > 40.0
    (task,) = done_json("path", "1,0,3", "0,0,3", "--holds", "2,0")
    assert task["elapsed_s"] > 4.0
    assert run("path", "1,0,3", "--holds", "1,2").stderr.startswith("ual: INVALID_ARGUMENT: holds_s: 2 for 1 waypoints")


def test_speeds_are_kept(flying: DaemonProcess) -> None:
    del flying
    (task,) = done_json("goto", "2", "0", "3", "--max-speed", "0.5")
    assert task["elapsed_s"] > 4.0


def test_what_takes_too_long_is_cancelled(flying: DaemonProcess) -> None:
    def go_to(limit_s: float) -> None:
        result = run("goto", "1000", "0", "3", "--timeout", str(limit_s))
        assert result.exit_code == 1
        told = f"ual: TIMEOUT: goto did not end within {limit_s:g} s; if it reached the UAV it is cancelled"
        assert result.stderr.startswith(told)

    flying.give_up_begun("go_to_waypoint", go_to)
    flying.wait_for("task_ended", task="go_to_waypoint")


@pytest.mark.parametrize(
    "words",
    [
        ["goto", "1", "1", "3", "--yaw", "inf"],
        ["goto-geo", "1", "1", "3", "--yaw", "inf"],
        ["frames", "add", "x", "0", "0", "0", "--yaw", "inf"],
        ["pose", "1", "1", "3", "--yaw", "inf"],
        ["velocity", "1", "0", "0", "--for", "1", "--yaw-rate", "inf"],
    ],
    ids=" ".join,
)
def test_an_infinite_angle_is_one_message(daemon: DaemonProcess, words: list[str]) -> None:
    del daemon
    result = run(*words)
    assert (result.exit_code, result.stdout) == (1, "")
    (line,) = result.stderr.splitlines()
    assert line.startswith("ual: ")


@pytest.mark.parametrize(
    "words",
    [
        ["goto", "1", "1", "3", "--yaw", "90"],
        ["goto-geo", "1", "1", "3", "--yaw", "90"],
        ["pose", "1", "1", "3", "--yaw", "90"],
        ["path", "1,1,3,90"],
        ["frames", "add", "x", "0", "0", "0", "--yaw", "90"],
        ["velocity", "1", "0", "0", "--for", "1", "--yaw-rate", "90"],
    ],
    ids=" ".join,
)
def test_an_angle_of_90_radians_is_refused_with_a_hint(words: list[str]) -> None:
    result = run(*words)
    assert result.exit_code == 2
    assert "90 radians are more than a full turn: 90deg? (or 90rad)" in " ".join(result.stderr.split())


@pytest.mark.parametrize(
    ("words", "status", "told"),
    [
        (["goto", "1", "1", "3", "--yaw", "-90deg"], 1, "ual: DAEMON_UNREACHABLE: "),
        (["goto", "--yaw=-1.57", "1", "1", "-3"], 1, "ual: DAEMON_UNREACHABLE: "),
        (["goto", "1", "1", "3", "--max-speed", "-1"], 1, "ual: DAEMON_UNREACHABLE: "),
        (["path", "1,1,3", "--corner-radius", "-1"], 1, "ual: DAEMON_UNREACHABLE: "),
        (["goto-geo", "1", "1", "3", "--timeout", "-1"], 2, "Invalid value for '--timeout': -1.0 is not in the range"),
        (["land", "--at", "-5"], 2, "Invalid value for '--at': '-5' is no time"),
        (["land", "--ns"], 2, "Option '--ns' requires an argument"),
    ],
    ids=str,
)
def test_the_value_of_an_option_may_be_negative(words: list[str], status: int, told: str) -> None:
    result = run("--address", "127.0.0.1:1", *words)
    assert result.exit_code == status
    assert told in result.stderr


@pytest.mark.parametrize(("text", "angle_rad"), [("6.28", 6.28), ("-6.28", -6.28), ("90rad", 90.0), ("720deg", 12.566)])
def test_other_angles_are_taken(text: str, angle_rad: float) -> None:
    assert values.angle(text) == pytest.approx(angle_rad, abs=1e-3)


def test_a_goal_below_the_ground_is_refused_in_words(flying: DaemonProcess) -> None:
    del flying
    for words in (["goto", "1", "1", "-5"], ["pose", "1", "1", "-5"], ["path", "1,1,3", "1,1,-5"]):
        result = run(*words)
        assert result.exit_code == 1
        assert result.stderr.startswith("ual: GEOFENCE: ")
        assert "below the floor (floor_m: 0, clearance_m: 0.5 in the configuration; z is up)" in result.stderr


def test_a_velocity_that_is_scaled_down_says_so(flying: DaemonProcess) -> None:
    del flying
    for words in (["--for", "0.1"], ["--dry-run", "--for", "1"]):
        result = run("velocity", "3.2", "0", "0.3", *words)
        assert result.exit_code == 0
        assert result.stderr == "ual: beyond the UAV's limits (ual info): scaled down to 1.60 0.00 0.15 m/s\n"
    assert run("velocity", "1", "0", "0", "--for", "0.1").stderr == ""


def test_a_yaw_rate_that_is_limited_says_so(flying: DaemonProcess) -> None:
    del flying
    result = run("velocity", "0", "0", "0", "--yaw-rate=-2rad", "--dry-run", "--for", "1")
    assert result.exit_code == 0
    assert result.stderr == "ual: beyond the UAV's limits (ual info): turns at -1.00 rad/s\n"


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("goto", ["X is to the east", "Z is up", "counter-clockwise"]),
        ("pose", ["east, north and up", "counter-clockwise"]),
        ("path", ["east, north and up", "counter-clockwise", "metres"]),
        ("velocity", ["VX is to the east", "VZ up", "m/s", "counter-clockwise"]),
        ("takeoff", ["metres above the ground", "ceiling_m"]),
    ],
)
def test_the_help_says_what_coordinates_mean(command: str, said: list[str]) -> None:
    text = " ".join(done(command, "--help").split())
    assert [words for words in said if words not in text] == []


def test_not_a_number_is_refused_by_the_daemon(flying: DaemonProcess) -> None:
    del flying
    result = run("goto", "nan", "0", "3")
    assert result.exit_code == 1
    assert result.stderr.startswith("ual: INVALID_ARGUMENT: waypoint.pose.position.x")


def test_a_plan_of_qgroundcontrol_is_executed_and_drawn(flying: DaemonProcess, tmp_path: Path) -> None:
    del flying
    (sample,) = done_json("watch", "--once")
    here = sample["position_geo"]
    places = [(here["latitude_deg"] + 2e-5, here["longitude_deg"]), (here["latitude_deg"], here["longitude_deg"])]
    items = [
        {"type": "SimpleItem", "command": 16, "frame": 3, "params": [0, 0, 0, None, latitude_deg, longitude_deg, 3.0]}
        for latitude_deg, longitude_deg in places
    ]
    file, picture = tmp_path / "mission.plan", tmp_path / "flown.svg"
    landing = {"type": "SimpleItem", "command": 21, "frame": 3, "params": [0] * 7}
    file.write_text(json.dumps({"fileType": "Plan", "mission": {"items": [*items, landing]}}))
    result = run("path", "--file", file, "--plot", picture)
    assert result.exit_code == 0
    assert "not flown: item 3: landing" in result.stderr
    assert result.stdout.startswith("FOLLOW_PATH SUCCEEDED")
    assert "<svg" in picture.read_text()


def north_of(latitude_deg: float, metres: float) -> float:
    return latitude_deg + math.degrees(metres / 6.37e6)


def test_a_plan_with_a_jump_and_a_delay_is_executed_as_it_says(flying: DaemonProcess, tmp_path: Path) -> None:
    del flying
    (sample,) = done_json("watch", "--once")
    latitude_deg, longitude_deg = sample["position_geo"]["latitude_deg"], sample["position_geo"]["longitude_deg"]
    ends = (latitude_deg, north_of(latitude_deg, 2.0))
    out, back = ({"command": 16, "frame": 3, "params": [0, 0, 0, None, at, longitude_deg, 3.0]} for at in ends)
    delay = {"command": 93, "frame": 2, "params": [1.5, -1, -1, -1, 0, 0, 0]}
    jump = {"command": 177, "frame": 2, "params": [1, 1, 0, 0, 0, 0, 0]}
    items = [{"type": "SimpleItem", "doJumpId": n, **each} for n, each in enumerate((out, back, delay, jump), 1)]
    file = tmp_path / "mission.plan"
    file.write_text(json.dumps({"fileType": "Plan", "mission": {"firmwareType": 12, "items": items}}))
    (planned,) = done_json("path", "--file", file, "--dry-run")
    assert planned["length_m"] == pytest.approx(3 * 2.0, abs=0.3)  # there, back and there
    (flown,) = done_json("path", "--file", file)
    assert min(planned["duration_s"], flown["elapsed_s"]) > 2 * 1.5
    with ual.Uav() as uav:
        assert uav.pose().pose.position.y == pytest.approx(2.0, abs=0.3)


def test_a_gpx_is_executed_once_it_is_reported_what_its_altitudes_count_from(
    flying: DaemonProcess, tmp_path: Path
) -> None:
    del flying
    (sample,) = done_json("watch", "--once")
    here = sample["position_geo"]
    point = f'<rtept lat="{north_of(here["latitude_deg"], 3.0)}" lon="{here["longitude_deg"]}"><ele>4</ele></rtept>'
    text = f"<gpx><rte>{point}</rte></gpx>"
    refused = run("path", "--file", "-", stdin=text)
    assert (refused.exit_code, refused.stdout) == (1, "")
    assert "standard input does not say what its altitudes count from" in refused.stderr
    assert done("path", "--file", "-", "--reference", "home", stdin=text).startswith("FOLLOW_PATH SUCCEEDED")
    with ual.Uav() as uav:
        position = uav.pose().pose.position
    assert [position.y, position.z] == pytest.approx([3.0, 4.0], abs=0.3)
    file = tmp_path / "route.gpx"
    file.write_text(text)
    result = run("waypoints", "fly", file, "--altitude", "2")
    assert result.exit_code == 0
    assert "ual: not flown: the altitudes of the file: all is flown 2 m above home" in result.stderr
    with ual.Uav() as uav:
        assert uav.pose().pose.position.z == pytest.approx(2.0, abs=0.3)


def test_a_picture_that_cannot_be_drawn_is_refused_before_anything_moves(flying: DaemonProcess, tmp_path: Path) -> None:
    del flying
    for picture, why in ((tmp_path / "flown.doc", ".png"), (tmp_path / "nowhere" / "flown.png", "cannot be written")):
        result = run("goto", "5", "0", "3", "--plot", picture)
        assert result.exit_code == 2
        assert why in result.stderr
    with ual.Uav() as uav:
        assert uav.pose().pose.position.x == pytest.approx(0.0, abs=0.2)


def test_a_waypoint_file_with_a_mistake_names_the_row(tmp_path: Path) -> None:
    file = tmp_path / "waypoints.jsonl"
    file.write_text('{"x": 1, "y": 2, "z": 3}\n{"x": 1}\n')
    result = run("waypoints", "fly", file)
    assert result.exit_code == 1
    assert f"{file}, line 2: " in result.stderr
    for words in (["waypoints", "fly"], ["path", "--file"]):
        result = run("--json", *words, tmp_path / "none.jsonl")
        assert result.exit_code == 1
        assert result.stderr.startswith("ual: INVALID_ARGUMENT: cannot read")
        assert json.loads(result.stdout)["error"]["reason"] == "INVALID_ARGUMENT"


def test_a_velocity_whose_stop_nobody_answers_has_failed() -> None:
    with fake_daemon.running() as deaf:  # it takes velocities, and knows of no abort
        result = run("--address", deaf.address, "velocity", "1", "0", "0", "--for", "0.2")
    assert (result.exit_code, result.stdout) == (1, "")
    assert "the UAV could not be stopped: " in result.stderr


# --- On a terminal ----------------------------------------------------------------------------------------------------


def test_a_long_manoeuvre_shows_its_progress_and_ctrl_c_cancels_it(flying: DaemonProcess) -> None:
    with Terminal("goto", "1000", "0", "3") as terminal:
        terminal.wait_for("m left")
        assert "FLYING_AUTO" in terminal.text
        terminal.interrupt()
        assert terminal.wait() == 130
    assert "cancelled: the UAV holds its position" in terminal.text
    flying.wait_for("task_ended", task="go_to_waypoint", reason="TASK_ABORTED")


def test_ctrl_c_stops_a_velocity_at_once(flying: DaemonProcess) -> None:
    with Terminal("velocity", "0.5", "0", "0", "--for", "600") as terminal, ual.Uav() as uav:
        terminal.wait_until(lambda: uav.velocity().twist.linear.x > 0.1)
        terminal.interrupt()
        assert terminal.wait() == 130
    assert "interrupted: the UAV stops" in terminal.text
    flying.wait_for("command", command="abort")


def test_watch_is_one_screen_of_every_uav(start_daemon: StartDaemon) -> None:
    for ns in ("uav_1", "uav_2"):
        start_daemon(ns=ns).wait_for("listening")
    with Terminal("watch", "--all") as terminal:
        for text in ("uav_1", "uav_2", "battery", "LANDED_DISARMED"):
            terminal.wait_for(text)
        terminal.interrupt()
        assert terminal.wait() == 130


def test_q_leaves_watch_and_the_terminal_as_it_was(start_daemon: StartDaemon) -> None:
    start_daemon(ns="uav_1").wait_for("listening")
    for words in (["watch", "--all"], ["watch"]):
        with Terminal(*words) as terminal:
            before = terminal.mode()
            terminal.wait_for("LANDED_DISARMED")
            terminal.press(b"x\x1b[Bq")
            assert terminal.wait() == 0
            # Shows the cursor again, and the screen that was there before.
            assert terminal.text.endswith("\x1b[?25h\x1b[?1049l")
            assert terminal.mode() == before


def test_watch_leaves_the_terminal_as_it_was_when_it_is_terminated(daemon: DaemonProcess) -> None:
    del daemon
    with Terminal("watch") as terminal:
        before = terminal.mode()
        terminal.wait_for("LANDED_")
        terminal.process.send_signal(signal.SIGTERM)
        assert terminal.wait() == 128 + signal.SIGTERM
        assert terminal.text.endswith("\x1b[?25h\x1b[?1049l")
        assert terminal.mode() == before


def test_watch_does_not_show_a_dead_uav_as_alive(start_daemon: StartDaemon) -> None:
    daemon = start_daemon()
    daemon.wait_for("listening")
    with Terminal("watch") as terminal:
        terminal.wait_for("LANDED_DISARMED")
        daemon.process.kill()
        terminal.wait_for("no telemetry for ")
        terminal.wait_for("it was LANDED_DISARMED")
        terminal.interrupt()
        assert terminal.wait() == 130


def test_watch_shows_the_others_next_to_one_that_does_not_answer(start_daemon: StartDaemon) -> None:
    start_daemon(ns="uav_2").wait_for("listening")
    Registration("uav_1", os.getpid(), "127.0.0.1:1", "light", 1.5).write()
    with Terminal("watch", "--all") as terminal:
        terminal.wait_for("DAEMON_UNREACHABLE")
        terminal.wait_for("LANDED_DISARMED")
        terminal.interrupt()
        assert terminal.wait() == 130


def test_tables_are_drawn_on_a_terminal(daemon: DaemonProcess) -> None:
    del daemon
    for words, texts in ((["list"], ["backend", "uav_1"]), (["info"], ["horizontal speed"]), (["frames"], ["parent"])):
        with Terminal(*words) as terminal:
            assert terminal.wait() == 0
        for text in texts:
            assert text in terminal.text


# --- Simulation and checks --------------------------------------------------------------------------------------------


def test_faults_begin_end_and_are_listed(daemon: DaemonProcess) -> None:
    del daemon
    ids = [
        done("sim", "fault", "begin", *words).strip()
        for words in (
            ["battery-low", "--percent", "5"],
            ["motors-weak", "--power", "0.4"],
            ["estimator-jumps", "--offset", "0,0,-1", "--period", "2"],
            ["command-refused", "--command", "take_off", "--text", "not today"],
            ["ack-lost", "--command", "arm"],
            ["ack-late", "--delay", "2"],
            ["position-lost", "--for", "1000"],
            ["link-lost", "--for", "1000"],
        )
    ]
    kinds = {fault["fault_id"]: fault["kind"] for fault in done_json("sim", "fault", "list")}
    assert list(kinds) == ids
    assert kinds[ids[0]] == "BatteryLow"
    lines = done("sim", "fault", "list").splitlines()
    assert len(lines) == len(ids)
    assert lines[0] == f"{ids[0]}\tbattery-low remaining_percent=5.0"
    assert lines[2] == f"{ids[2]}\testimator-jumps offset=0,0,-1 period_s=2.0"
    assert lines[3] == f"{ids[3]}\tcommand-refused command=take_off text=not today"
    done("sim", "fault", "end", ids[0])
    assert ids[0] not in done("sim", "fault", "list")
    done("sim", "fault", "end")
    assert done("sim", "fault", "list") == ""


def test_the_world_of_a_simulated_uav_is_set(daemon: DaemonProcess) -> None:
    del daemon
    done("sim", "noise", "0.01", "0.01")
    done("sim", "wind", "1", "-1")
    done("sim", "speed", "0")
    (before,) = done_json("watch", "--once")
    done("sim", "step", "5")
    (after,) = done_json("watch", "--once")
    assert after["stamp_s"] - before["stamp_s"] == pytest.approx(5.0, abs=0.1)
    assert done_json("sim", "speed", "inf") == [{"done": "sim speed", "speed_factor": "inf"}]
    refused = run("sim", "step", "1")
    assert (refused.exit_code, refused.stderr.startswith("ual: WRONG_STATE: ")) == (1, True)


def test_the_parts_of_a_simulation_are_listed_and_the_uav_is_placed(daemon: DaemonProcess) -> None:
    del daemon
    assert done("sim", "parts").splitlines() == ["faults", "noise", "pilot", "place", "time", "wind"]
    done("sim", "place", "5", "-2", "--yaw", "90deg")
    (sample,) = done_json("watch", "--once")
    assert sample["pose"]["position"] == {"x": 5.0, "y": -2.0, "z": 0.0}


def test_poses_of_a_file_are_passed_as_poses_from_outside(daemon: DaemonProcess, tmp_path: Path) -> None:
    del daemon
    file = tmp_path / "poses.csv"
    file.write_text("# x,y,z,yaw\n1,2,0,90deg\n\n1,2,0,0,0,0,1  # the same, as a quaternion\n")
    assert done_json("extpose", "--file", str(file), "--rate", "200") == [{"done": "extpose", "sent_count": 2}]
    assert done("extpose", "--file", "-", "--std-dev", "0.01", stdin="1,2,0,0\n") == "1 poses given\n"


def test_poses_are_read_as_windows_writes_them(daemon: DaemonProcess, tmp_path: Path) -> None:
    del daemon
    file = tmp_path / "poses.csv"
    for data in ("\ufeff1,2,0,90deg\r\n".encode(), "1,2,0,90deg\r\n".encode("utf-16"), b"# \xdc\r1,2,0,0\r"):
        file.write_bytes(data)
        assert done("extpose", "--file", str(file), "--rate", "1000") == "1 poses given\n"
    for typed in ("\ufeff1,2,0,0\n".encode(), b"1,2,0,0 # \xdc\r\n"):
        result = CliRunner().invoke(cli, ["extpose", "--file", "-"], input=typed)
        assert (result.exit_code, result.output) == (0, "1 poses given\n")
    file.write_bytes(b"\0\1\2\3")
    assert f"{file} is not a text file" in run("extpose", "--file", str(file)).stderr
    file.write_text("# none\n")
    assert f"{file} has no poses" in run("extpose", "--file", str(file)).stderr


@pytest.mark.parametrize("line", ["1,2,0", "1,2,0,0,1", "1,2,x,0", "1_0,2,0,0", "1,2,0,0,0,0,1_0", "1,2,nan,0"])
def test_a_pose_that_cannot_be_read_is_named(daemon: DaemonProcess, line: str) -> None:
    del daemon
    refused = run("extpose", "--file", "-", stdin=f"{line}\n")
    assert refused.exit_code == 1
    assert f"standard input, line 1: '{line}' is neither X,Y,Z,YAW nor" in refused.stderr


def test_check_asks_before_anything_moves(daemon: DaemonProcess) -> None:
    result = run("check", stdin="n\n")
    assert result.exit_code == 1
    assert "uav_1 (light) will move, within 6 m" in result.stderr
    assert "takes off: straight up to 2 m" in result.stderr
    assert "flies_nothing_on_the_ground" in done("check", "--list")
    assert not [event for event in daemon.events if event.get("event") == "command"]


def test_check_without_an_answer_flies_nothing_and_says_how_to_answer(daemon: DaemonProcess) -> None:
    result = run("check", stdin="")
    assert result.exit_code == 1
    assert "Aborted" not in result.stderr
    assert result.stderr.endswith("no answer came; with --yes it flies without asking\n")
    assert not [event for event in daemon.events if event.get("event") == "command"]


def test_check_runs_what_was_chosen_and_tells_how_it_ended(daemon: DaemonProcess) -> None:
    wait_for_state(State.LANDED_ARMED)
    results = done_json("check", "--yes", "--only", "takes_off", "--only", "arming_belongs_to_the_pilot")
    assert {each["check"]: each["outcome"] for each in results} == {
        "takes_off": "passed",
        "arming_belongs_to_the_pilot": "skipped",
    }
    daemon.wait_for("task_done", task="land")
    text = done("check", "--no-motion", "--only", "says_who_it_is", "--only", "takes_off")
    assert [line.split("\t")[:2] for line in text.splitlines()] == [
        ["says who it is", "passed"],
        ["takes off", "skipped"],
    ]


def test_a_failed_check_ends_with_status_1(daemon: DaemonProcess) -> None:
    wait_for_state(State.LANDED_ARMED)
    done("sim", "fault", "begin", "command-refused", "--command", "take_off")
    (result,) = [
        json.loads(line) for line in run("--json", "check", "--yes", "--only", "takes_off").stdout.splitlines()
    ]
    assert (result["outcome"], result["why"].partition(":")[0]) == ("failed", "REJECTED_BY_AUTOPILOT")
    assert run("check", "--yes", "--only", "takes_off").exit_code == 1
    assert daemon.process.poll() is None
