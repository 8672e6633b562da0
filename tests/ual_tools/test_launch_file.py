"""The file of a team, and what is written instead of running it (``--print``, ``--systemd``, ``--compose``)."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from click.testing import CliRunner, Result

import ual_tools
from tests.conftest import LIMIT_S
from ual.types import State, Telemetry
from ual_tools.launch import team_file
from ual_tools.launch.boot import landing_of
from ual_tools.launch.flying import SENDS_NOTHING
from ual_tools.launch.systemd import HARDENING
from ual_tools.launch.team import AtEnd, Ready, ReadyCondition, Restart
from ual_tools.launch.team_file import load
from ual_tools.main import cli
from ual_tools.output import to_json
from ual_tools.strict_yaml.loading import YamlFileError
from ual_tools.strict_yaml.placeholders import PlaceholderError, fill

DOCS = Path(__file__).parents[2] / "docs"
PAGE = DOCS / "reference" / "team-file.md"
_EXAMPLES = (DOCS / "how-to" / "launch.md").read_text() + PAGE.read_text()
DEPLOYED = Path(__file__).parents[2] / "deploy" / "systemd" / "ual-daemon@.service"

SURVEY = """\
name: survey
at_end: hold
image: ual:1
before:
  - name: world
    run: [sh, -c, 'echo "$HOME"']
    ready: {port: 5760}
uavs:
  - count: 2
    first: 3
    backend: mavlink
    url: udpin://127.0.0.1:{14539 + index}
    home_pose: [0, "{-6+2*index}", 0]
    model: iris
    config:
      allow_arming: true
      limits: {climb_speed_m_s: 2}
      log_format: "json"
      frames:
        - {frame_id: "{ns}/arm", x: 1e-1}
    with:
      - name: px4-{index}
        run: px4 -i {index} --model '{model}' --grpc {port}
        env: {PX4_ID: "{index}"}
        ready: {file: "px4-{index}.ready"}
        stop_signal: INT
  - ns: boat
    restart: on-failure
    ends_team: false
after:
  - name: mission
    run: [ual, --ns, "{uavs}", takeoff, "5"]
    ends_team: true
  - name: viewer
    run: ual watch --all
    end: last
"""


@pytest.fixture(autouse=True)
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Finds each program in /opt/ual/bin, whatever this computer has."""

    def which(name: str) -> str | None:
        return name if "/" in name else f"/opt/ual/bin/{name}"

    monkeypatch.setattr(shutil, "which", which)
    monkeypatch.setattr("sys.argv", ["/opt/ual/bin/ual"])


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "survey.yaml"
    path.write_text(SURVEY)
    return path


def run(*words: str) -> Result:
    return CliRunner().invoke(cli, ["launch", *words])


def test_a_file_is_a_team(file: Path) -> None:
    team = load(file)
    assert (team.name, team.at_end) == ("survey", AtEnd.HOLD)
    by_name = {each.name: each for each in team.programs}
    assert list(by_name) == ["world", "px4-3", "uav_3", "px4-4", "uav_4", "boat", "mission", "viewer"]
    assert [each.ns for each in team.daemons] == ["uav_3", "uav_4", "boat"]
    assert {name: each.needs for name, each in by_name.items()} == {
        "world": (),
        "px4-3": ("world",),
        "uav_3": ("px4-3",),
        "px4-4": ("world",),
        "uav_4": ("px4-4",),
        "boat": ("world",),
        "mission": ("uav_3", "uav_4", "boat"),
        "viewer": ("mission",),
    }
    assert by_name["world"].ready == Ready(ReadyCondition.PORT, "127.0.0.1:5760")
    assert by_name["px4-4"].argv == ("px4", "-i", "4", "--model", "iris", "--grpc", "50054")
    assert by_name["px4-4"].env == {"PX4_ID": "4"}
    assert by_name["px4-4"].ready == Ready(ReadyCondition.FILE, str(file.parent / "px4-4.ready"))
    assert by_name["uav_4"].argv[1:] == (
        *("--ns", "uav_4", "--backend", "mavlink", "--url", "udpin://127.0.0.1:14543"),
        *("--set", "home_pose=[0, 2, 0]", "--set", "allow_arming=true"),
        *("--set", 'limits={"climb_speed_m_s": 2}', "--set", 'log_format="json"'),
        *("--set", 'frames=[{"frame_id": "uav_4/arm", "x": 1e-1}]'),
    )
    assert (by_name["uav_3"].restart, by_name["uav_3"].is_ending_team) == (Restart.ALWAYS, True)
    assert (by_name["boat"].restart, by_name["boat"].is_ending_team) == (Restart.ON_FAILURE, False)
    assert by_name["mission"].argv == ("ual", "--ns", "uav_3,uav_4,boat", "takeoff", "5")
    assert [each.name for each in team.programs if each.is_ended_first] == ["mission"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("at_end: hold", "at_ende: hold", "2: at_ende: there is no such key. Did you mean at_end?"),
        ("at_end: hold", "at_end: lnad", "2: at_end: expected land, hold, got 'lnad'. Did you mean land?"),
        (
            "    backend: mavlink",
            "    bakend: mavlink",
            "11: uavs[0].bakend: there is no such key. Did you mean backend?",
        ),
        ("count: 2", "count: 0", "9: uavs[0].count: expected a number of at least 1"),
        ("count: 2", "count: 1.5", "9: uavs[0].count: expected a whole number"),
        ("count: 2", "count: two", "9: uavs[0].count: expected a number, got 'two'"),
        ("{14539 + index}", "{indx}", "12: uavs[0].url: {indx}: there is no such placeholder"),
        ("{14539 + index}", "{__import__('os')}", "12: uavs[0].url: {__import__('os')}: there is no such placeholder"),
        ("{14539 + index}", "{9", "12: uavs[0].url: a { stands alone; write {{ for the character"),
        ("px4-{index}\n", "px4\n", "1: two programs have the name 'px4'; use {index} in it"),
        ("ready: {port: 5760}", "ready: {port: 99999}", "7: before[0].ready.port: expected PORT or HOST:PORT of TCP"),
        ("ready: {port: 5760}", "ready: {log: '('}", "7: before[0].ready.log: is not a regular expression"),
        (
            "ready: {port: 5760}",
            "ready: {port: 1, file: a}",
            "7: before[0].ready: expected one of port, file, log, exit",
        ),
        ("restart: on-failure", "restart: true", "28: uavs[1].restart: expected always, on-failure, no, got 'true'"),
        ("ends_team: false", "ends_team: 0", "29: uavs[1].ends_team: expected true or false, got '0'"),
        ("- ns: boat", "- ns: a boat", "27: uavs[1].ns: 'a boat' is not a namespace"),
        ("- ns: boat", "- ns: uav_3", "1: two programs have the name 'uav_3'"),
        ("allow_arming: true", "fleet: 3", "16: uavs[0].config.fleet: each UAV has a daemon of its own here"),
        ("allow_arming: true", "url: x", "16: uavs[0].config.url: it is a key of the UAV itself"),
        ("stop_signal: INT", "stop_signal: KILL", "26: uavs[0].with[0].stop_signal: expected TERM, INT, HUP, QUIT"),
        ("run: ual watch --all", "run: ual 'watch", "35: after[1].run: No closing quotation"),
        ("end: last", "end: never", "36: after[1].end: expected first (before the UAVs land) or last, got 'never'"),
        ("name: survey\n", "name: survey\nname: b\n", "2: name: given twice"),
        ("name: survey\n", "name: [\n", "3: while parsing a flow sequence"),
        ("uavs:", "uavs: []\nunused:", "9: unused: there is no such key"),
    ],
)
def test_what_is_wrong_is_named_with_its_row(file: Path, old: str, new: str, message: str) -> None:
    assert old in SURVEY
    file.write_text(SURVEY.replace(old, new, 1))
    result = run("--print", str(file))
    assert result.exit_code == 2
    assert f"{file}:{message}" in result.stderr
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("uavs: {uav_1: {}}", "1: uavs: expected a list: a line that begins with '- ' for each"),
        ("uavs: [uav_1]", "1: uavs[0]: expected 'key: value' lines (ns, count, "),
        ("daemons: []", "1: daemons: there is no such key. There are name, at_end, land_limit_s, image, before, uavs,"),
    ],
)
def test_what_is_expected_instead_of_another_form_is_named(file: Path, text: str, message: str) -> None:
    file.write_text(text)
    assert f"{file}:{message}" in run("--print", str(file)).stderr


def test_a_file_that_would_grow_without_end_is_refused(file: Path) -> None:
    levels = "".join(f"b{i}: &b{i} [{f'*b{i - 1}, ' * 50}]\n" for i in range(1, 6))
    file.write_text("b0: &b0 [" + "1, " * 50 + "]\n" + levels)
    with pytest.raises(YamlFileError, match="more than 100000 values"):
        load(file)
    file.write_text("a: &a [*a]\n")
    with pytest.raises(YamlFileError, match="contains itself"):
        load(file)
    file.write_text("a: !!python/object/apply:os.system [true]\nuavs: []\n")
    with pytest.raises(YamlFileError, match="no such key"):
        load(file)


@pytest.mark.parametrize("content", [b"", b"\xff\xff", b"[]", b"x" * (1 << 20) + b"x"])
def test_what_is_no_file_of_a_team_is_refused(file: Path, content: bytes) -> None:
    file.write_bytes(content)
    with pytest.raises(YamlFileError, match=str(file)):
        load(file)
    with pytest.raises(YamlFileError, match="not a regular file"):
        load(Path("/dev/zero"))


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("{index}", "3"),
        ("{14540+index}", "14543"),
        ("{14540 + 10*index}", "14570"),
        ("{2*index-6}", "0"),
        ("{-1*index}", "-3"),
        ("{{index}}", "{index}"),
        ("a{index}b{index-1}", "a3b2"),
    ],
)
def test_placeholders_are_sums_and_products_of_the_index(text: str, value: str) -> None:
    assert fill(text, {"index": "3"}) == value


@pytest.mark.parametrize("text", ["{}", "{index/2}", "{index**9}", "{ns}", "{", "a}"])
def test_nothing_else_is_a_placeholder(text: str) -> None:
    with pytest.raises(PlaceholderError):
        fill(text, {"index": "3"})


def test_print_shows_the_command_rows(file: Path) -> None:
    result = run("--print", str(file))
    assert result.exit_code == 0, result.output
    where = f"cd {file.parent} && "
    lines = result.stdout.splitlines()
    assert lines[:6] == [
        "# world; ready by port 127.0.0.1:5760; restart no",
        where + "sh -c 'echo \"$HOME\"'",
        f"# px4-3; after world; ready by file {file.parent}/px4-3.ready; restart no",
        where + "PX4_ID=3 px4 -i 3 --model iris --grpc 50053",
        "# uav_3; after px4-3; ready by serving; restart always",
        where + "/opt/ual/bin/ual-daemon --ns uav_3 --backend mavlink --url udpin://127.0.0.1:14542 "
        "--set 'home_pose=[0, 0, 0]' --set allow_arming=true --set 'limits={\"climb_speed_m_s\": 2}' "
        '--set \'log_format="json"\' --set \'frames=[{"frame_id": "uav_3/arm", "x": 1e-1}]\'',
    ]


def test_print_tells_a_program_the_same(file: Path) -> None:
    result = CliRunner().invoke(cli, ["--json", "launch", "--print", str(file)])
    assert result.exit_code == 0, result.output
    told = [json.loads(line) for line in result.stdout.splitlines()]
    assert [each["ns"] for each in told if each["ns"]] == ["uav_3", "uav_4", "boat"]
    assert told[1] == {
        "name": "px4-3",
        "ns": "",
        "command": ["px4", "-i", "3", "--model", "iris", "--grpc", "50053"],
        "directory": str(file.parent),
        "variables": {"PX4_ID": "3"},
        "needs": ["world"],
    }


def test_without_the_daemon_it_says_what_to_install(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda _: None)
    result = run("--print", str(file))
    assert result.exit_code == 2
    assert "pip install ual-daemon" in result.stderr


def test_the_units_start_the_same_programs_in_the_same_order(file: Path, tmp_path: Path) -> None:
    file.write_text(SURVEY.replace("at_end: hold", "at_end: land"))
    result = run("--systemd", str(tmp_path / "units"), str(file))
    assert result.exit_code == 0, result.output
    units = {path.name: path.read_text() for path in (tmp_path / "units").iterdir()}
    names = ("world", "px4-3", "uav_3", "px4-4", "uav_4", "boat", "mission", "viewer", "end")
    assert set(units) == {"ual-survey.target", *(f"ual-survey-{name}.service" for name in names)}
    daemon = units["ual-survey-uav_3.service"]
    assert daemon.startswith(
        "[Unit]\nDescription=UAL team survey: uav_3\nPartOf=ual-survey.target\n"
        "After=network.target ual-survey-px4-3.service\nWants=ual-survey-px4-3.service\n"
    )
    assert (
        "\nExecStart=/opt/ual/bin/ual-daemon --ns uav_3 --backend mavlink --url udpin://127.0.0.1:14542 "
        '--set "home_pose=[0, 0, 0]" --set allow_arming=true --set "limits={\\"climb_speed_m_s\\": 2}" '
    ) in daemon
    assert "--ns uav_3 state | grep -qv UNINITIALIZED; do sleep 0.2; done" in daemon
    assert "ExecStop=-/opt/ual/bin/bash -c " in daemon
    assert "--ns uav_3 --take --timeout 120 land" in daemon
    assert 'ExecStart=/opt/ual/bin/sh -c "echo \\"$$HOME\\""' in units["ual-survey-world.service"]
    assert ": < /dev/tcp/127.0.0.1/5760" in units["ual-survey-world.service"]
    assert "KillSignal=SIGINT" in units["ual-survey-px4-4.service"]
    assert "OnFailure=ual-survey-end.service" in units["ual-survey-mission.service"]


def test_a_daemon_is_hardened_as_the_unit_of_a_single_one() -> None:
    deployed = DEPLOYED.read_text().splitlines()
    assert [line for line in HARDENING.splitlines() if line not in deployed] == ["ProtectHome=read-only"]
    ours = {line.partition("=")[0] for line in HARDENING.splitlines()}
    own = {"ExecStart", "Restart", "RestartSec", "RestartPreventExitStatus", "TimeoutStopSec"}
    service = DEPLOYED.read_text().partition("[Service]")[2].partition("[Install]")[0].splitlines()
    assert {line.partition("=")[0] for line in service if "=" in line and line[0] != "#"} == ours | own


@pytest.mark.skipif(
    shutil.which("systemd-analyze") is None,
    reason="SYSTEMD IS MISSING, the units of a team are NOT TESTED: apt-get install systemd",
)
def test_systemd_takes_the_units(file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: "/bin/true" if "/" in name or name == "px4" else f"/bin/{name}")
    monkeypatch.setattr("ual_tools.launch.systemd._found", lambda *_, **__: "/bin/true")
    assert run("--systemd", str(tmp_path / "units"), str(file)).exit_code == 0
    units = sorted(map(str, (tmp_path / "units").iterdir()))
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", *units], capture_output=True, text=True, timeout=LIMIT_S
    )
    assert not [line for line in done.stderr.splitlines() if "ual-survey" in line], done.stderr
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("state", "reason", "is_landed"),
    [
        ("FLYING_AUTO", "mode OFFBOARD", True),
        ("FLYING_AUTO", f"mode OFFBOARD; {SENDS_NOTHING}", False),
        ("FLYING_MANUAL", "mode AUTO.MISSION does not take our references", False),
        ("LANDED_DISARMED", "not armed", False),
    ],
)
def test_only_a_uav_that_ual_flies_is_landed_at_the_end(
    file: Path, tmp_path: Path, state: str, reason: str, is_landed: bool
) -> None:
    """`land` would end a ground station's mission, too."""
    sample = json.dumps(to_json(Telemetry(State[state], state_reason=reason)))
    ual, calls = tmp_path / "ual", tmp_path / "calls"
    ual.write_text(f'#!/bin/sh\ncase "$*" in *watch*) echo {shlex.quote(sample)};; *) echo "$*" >>{calls};; esac\n')
    ual.chmod(0o755)
    team = load(file)
    command = landing_of(replace(team, at_end=AtEnd.LAND), team.daemons[0], str(ual))
    assert command is not None
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=LIMIT_S)
    assert (done.returncode, done.stderr) == (0, "")
    assert calls.exists() == is_landed
    assert not is_landed or calls.read_text() == "--ns uav_3 --take --timeout 120 land\n"


def test_the_compose_file_has_the_same_programs(file: Path, tmp_path: Path) -> None:
    file.write_text(SURVEY.replace("at_end: hold", "at_end: land"))
    result = run("--compose", str(tmp_path / "compose.yaml"), str(file))
    assert result.exit_code == 0, result.output
    text = (tmp_path / "compose.yaml").read_text()
    assert "# Compose does not end the team when mission has ended" in text
    services = yaml.safe_load(text)["services"]
    assert list(services) == ["world", "px4-3", "uav_3", "px4-4", "uav_4", "boat", "mission", "viewer"]
    assert services["world"]["command"] == ["sh", "-c", 'echo "$$HOME"']
    assert services["uav_3"]["command"][:3] == ["ual-daemon", "--ns", "uav_3"]
    assert services["uav_3"]["depends_on"] == {"px4-3": {"condition": "service_healthy"}}
    check = services["uav_3"]["healthcheck"]
    assert check["test"] == ["CMD", "env", "UAL_NS=uav_3", "ual-health"]
    assert (check["start_interval"], check["interval"]) == ("1s", "10s"), "often at the start, seldom in flight"
    assert services["uav_3"]["pre_stop"][0]["command"][2].endswith("ual --ns uav_3 --take --timeout 120 land")
    assert {name: each["restart"] for name, each in services.items()} == {
        **dict.fromkeys(services, "no"),
        "uav_3": "always",
        "uav_4": "always",
        "boat": "on-failure",
    }


def test_daemons_and_the_command_have_an_image_of_their_own(file: Path, tmp_path: Path) -> None:
    file.write_text("uavs: [{count: 1}]\nafter: [{name: mission, run: [ual, takeoff, '3']}]\n")
    result = run("--compose", str(tmp_path / "compose.yaml"), str(file))
    assert result.exit_code == 0, result.output
    services = yaml.safe_load((tmp_path / "compose.yaml").read_text())["services"]
    for service in services.values():
        assert service["image"] == f"ual:{ual_tools.__version__}"
        assert (service["read_only"], service["cap_drop"], service["tmpfs"]) == (True, ["ALL"], ["/tmp"])
        assert service["security_opt"] == ["no-new-privileges:true"]


@pytest.mark.parametrize(
    ("change", "option", "why"),
    [
        (("ready: {port: 5760}", "ready: {log: up}"), "--systemd", "world: ready by log: only `ual launch` itself"),
        (("image: ual:1\n", ""), "--compose", "world: a compose file needs its image"),
    ],
)
def test_what_cannot_be_written_is_reported(
    file: Path, tmp_path: Path, change: tuple[str, str], option: str, why: str
) -> None:
    file.write_text(SURVEY.replace(*change))
    result = run(option, str(tmp_path / "out"), str(file))
    assert result.exit_code == 2
    assert why in result.stderr
    assert not (tmp_path / "out").exists()


def test_the_files_of_the_page_are_teams(file: Path) -> None:
    teams = []
    for text in re.findall("```yaml\n(.*?)```", _EXAMPLES, re.DOTALL):
        file.write_text(text)
        teams.append([each.name for each in load(file).programs])
    assert teams == [
        ["uav_1", "uav_2", "mission"],
        ["world", "px4-1", "uav_1", "px4-2", "uav_2", "px4-3", "uav_3", "viewer", "mission"],
    ]


def test_the_page_documents_each_key() -> None:
    page = PAGE.read_text()
    for heading, keys in (
        ("key of the file", team_file._TEAM),
        ("key of a UAV", team_file._UAV),
        ("key of a program", team_file._AFTER),
    ):
        table = page.partition(f"| {heading} |")[2].partition("\n\n")[0]
        cells = [line.split("|")[1] for line in table.splitlines()[2:]]
        assert set(re.findall(r"`(\w+)`", " ".join(cells))) == set(keys), heading
