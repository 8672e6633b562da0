"""The pages agree with the code: links, names and commands exist, programs run, tables are complete."""

from __future__ import annotations

import inspect
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import click
import msgspec
import pytest
from click.testing import CliRunner, Result

import ual
from tests.conftest import DaemonProcess, StartDaemon
from tests.pages import (
    ROOT,
    Page,
    broken_links,
    commands,
    missing_names,
    missing_paths,
    missing_targets,
    pages,
    read,
    relative_search_paths,
    shown_answers,
    why_wrong,
    wrong_commands,
)
from tools.pages.__main__ import out_of_date
from ual import errors
from ual_daemon.backends.light import LightSettings
from ual_daemon.backends.values import Cause
from ual_daemon.flight.policy.following import Trouble
from ual_daemon.program.configuration import DaemonSettings
from ual_daemon.settings import (
    FrameSettings,
    GeofenceSettings,
    LimitSettings,
    PayloadSettings,
    ToleranceSettings,
    VehicleSettings,
)
from ual_tools.main import cli

DOCS = ROOT / "docs"
HOVER = ROOT / "examples" / "third_party_backend"
ARM = ROOT / "examples" / "arm_extension"
TLS = ROOT / "tests" / "data" / "tls"
CHECKS: tuple[Callable[[Page], list[str]], ...] = (
    broken_links,
    missing_paths,
    missing_names,
    missing_targets,
    relative_search_paths,
    wrong_commands,
)

# --- Every page -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", pages(), ids=lambda path: str(path.relative_to(ROOT)))
def test_links_names_and_commands_of_a_page_exist(path: Path) -> None:
    page = read(path)
    assert {check.__name__: mistakes for check in CHECKS if (mistakes := check(page))} == {}


def test_the_pages_are_found() -> None:
    found = {path.relative_to(ROOT).as_posix() for path in pages()}
    assert {"README.md", "docs/reference/cli.md", "clients/go/README.md", "deploy/gateway/README.md"} <= found
    assert not any(name.startswith((".venv", "build")) or "node_modules" in name for name in found)


PLANTED = [
    (broken_links, "[the manual](no-such-page.md)", "no-such-page.md"),
    (broken_links, "[here](daemon.md#no-such-heading)", "daemon.md#no-such-heading"),
    (broken_links, "[above](#no-such-heading)", "#no-such-heading"),
    (broken_links, "[a folder](decisions)", "decisions"),
    (missing_paths, "see `ual_daemon/no_such_module.py`", "ual_daemon/no_such_module.py"),
    (missing_paths, "see tests/no_such_folder for more", "tests/no_such_folder"),
    (missing_paths, "in `no_such_file.py`", "no_such_file.py"),
    (missing_names, "the module `ual_daemon.backends.no_such_backend`", "ual_daemon.backends.no_such_backend"),
    (missing_names, "the member `ual.Uav.no_such_member`", "ual.Uav.no_such_member"),
    (missing_names, "    grpcurl 127.0.0.1:50051 ual.v1.UalService/NoSuchMethod\n", "ual.v1.UalService/NoSuchMethod"),
    (relative_search_paths, "set `PATH=$PATH:../../tools/bin`", "../../tools/bin"),
    (relative_search_paths, "    PATH=.venv/bin:$PATH ual list\n", ".venv/bin"),
    (missing_targets, "run `make no-such-target`", "no-such-target"),
    (wrong_commands, "    ual no-such-command\n", "ual no-such-command: no command no-such-command"),
    (wrong_commands, "    ual goto 1 2 3 --no-such-flag\n", "ual goto 1 2 3 --no-such-flag: no flag --no-such-flag"),
    (wrong_commands, "```console\n$ ual-daemon --no-such-flag 1\n```\n", "ual-daemon --no-such-flag 1: no flag"),
    (wrong_commands, "use `ual sim fault no-such-fault`", "ual sim fault no-such-fault: no command no-such-fault"),
    (wrong_commands, "    ual land 3\n", "ual land 3: Got unexpected extra argument"),
    (wrong_commands, "    ual sim arm; ual goto 1 2   # m\n", "ual goto 1 2: Missing argument"),
]


@pytest.mark.parametrize(("check", "text", "mistake"), PLANTED)
def test_a_planted_mistake_is_found(check: Callable[[Page], list[str]], text: str, mistake: str) -> None:
    [found] = check(Page(DOCS / "planted.md", f"# Planted\n\n{text}\n"))
    assert found.startswith(mistake)


RIGHT = """# A heading, with `code`

[the page](daemon.md), [a part](daemon.md#addresses), [above](#a-heading-with-code), [outside](https://example.org/no#where)
`ual_daemon/backends/base.py`, `base.py`, tests/data, `ual_daemon.backends.base`, `ual.PathHeading.FIXED`, `make test`

    UAL_NS=uav_2 ual goto -1 2 3 --yaw 90deg   # west
    $ ual --json watch --rate 1 | jq .state
    ual-daemon --config uav.yaml --set light.seed=1 &
"""


def test_what_is_right_is_not_called_a_mistake() -> None:
    page = Page(DOCS / "reference" / "right.md", RIGHT)
    assert [check(page) for check in CHECKS] == [[]] * len(CHECKS)


# --- Commands ---------------------------------------------------------------------------------------------------------


def first_cells(page: Page) -> list[str]:
    """The code in the first cells of the tables of a page."""
    cells = re.findall(r"^\| (.+?) \|", page.text.replace(r"\|", "¦"), re.MULTILINE)
    return [code for cell in cells for code in re.findall(r"`([^`]+)`", cell)]


def test_the_table_of_commands_is_complete() -> None:
    table = read(DOCS / "reference" / "cli.md")
    listed = [code for code in first_cells(table) if code.split()[0] in cli.commands]
    assert {code.split()[0] for code in listed} == set(cli.commands)
    assert [
        why for code in listed if (why := why_wrong(f"ual {code.replace('[', '').replace(']', '')}", is_block=False))
    ] == []


def test_the_table_of_faults_is_complete() -> None:
    group = cli.commands["sim"]
    for name in ("fault", "begin"):
        assert isinstance(group, click.Group)
        group = group.commands[name]
    assert isinstance(group, click.Group)
    listed = [
        code
        for code in first_cells(read(DOCS / "reference" / "backends" / "light.md"))
        if code.split()[0] in group.commands
    ]
    assert {code.split()[0] for code in listed} == set(group.commands)
    assert [why for code in listed if (why := why_wrong(f"ual sim fault begin {code}"))] == []


def typed(call: str) -> Result:
    return CliRunner().invoke(cli, shlex.split(call, comments=True)[1:])


def test_the_commands_of_the_light_backends_page_are_done_from_top_to_bottom(start_daemon: StartDaemon) -> None:
    page = read(DOCS / "reference" / "backends" / "light.md")
    calls = [call for call, is_block in commands(page) if is_block and call.startswith("ual ")]
    assert len(calls) >= 20
    start_daemon("--set", "light.speed_factor=10").wait_for("state", new="LANDED_DISARMED")
    for call in calls:
        result = typed(call)
        assert result.exit_code == 0, f"{call}\n{result.output}"


def test_the_answers_that_the_page_of_the_command_shows_are_what_comes(daemon: DaemonProcess) -> None:
    pages_with_answers = (DOCS / "reference" / "cli.md", DOCS / "how-to" / "write-a-script.md")
    answers = [each for path in pages_with_answers for each in shown_answers(read(path))]
    assert len(answers) >= 4
    daemon.wait_for("state", new="LANDED_ARMED")
    assert typed("ual takeoff 3").exit_code == 0
    for call, shown in answers:
        output = typed(call).output
        assert without_times(output) == without_times(shown), f"{call}\nanswers\n{output}"


def without_times(answer: str) -> str:
    """An answer of `ual check` without the times that its checks took."""
    return re.sub(r"[\t\d.]+$", "", answer.strip(), flags=re.MULTILINE)


PRINT_CONFIGURATIONS = """
import json, sys
from click.testing import CliRunner
from ual_daemon.program.main import main

for flags in json.load(sys.stdin):
    result = CliRunner().invoke(main, [*flags, "--print-config"])
    print(json.dumps([result.exit_code, result.output]))
"""


def refused_configurations(calls: Sequence[Sequence[str]]) -> list[str]:
    """Returns the errors of `ual-daemon` about flags that it does not accept. All in one process, since imports take
    long.
    """
    environment = {name: value for name, value in os.environ.items() if not name.startswith("UAL_")}
    done = subprocess.run(
        [sys.executable, "-c", PRINT_CONFIGURATIONS],
        input=json.dumps(calls),
        env=environment,
        capture_output=True,
        text=True,
        timeout=100.0,
    )
    assert done.returncode == 0, done.stderr
    results = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(results) == len(calls)
    return [output for status, output in results if status != 0]


OTHERS = (
    "hover",
    "uav.yaml",
    "uav_1.pem",
    "/var/log/ual",
    "--extension",
    "flight.mcap",
    "FILE",
    "NAME",
    "/dev/tty",
    "/etc/ual",
    "…",
)
"""Parts of calls that need what a test does not have."""


def test_the_daemon_accepts_the_flags_that_the_pages_show() -> None:
    shown = {call for path in pages() for call, is_block in commands(read(path)) if is_block}
    calls = [call for call in shown if call.startswith("ual-daemon ") and not any(other in call for other in OTHERS)]
    assert len(calls) >= 10
    assert refused_configurations([shlex.split(call)[1:] for call in calls]) == []


def test_a_configuration_that_the_daemon_refuses_is_found() -> None:
    [refusal] = refused_configurations([["--ns", "uav_2"], ["--set", "light.no_such_setting=1"]])
    assert "no_such_setting" in refusal


def test_the_daemon_accepts_the_file_that_the_page_shows(tmp_path: Path) -> None:
    [text] = blocks(DOCS / "reference" / "configuration.md", "yaml")
    file = tmp_path / "uav.yaml"
    for name, ours in (("uav_2.pem", "certificate.pem"), ("uav_2.key", "key.pem")):
        assert f"/etc/ual/{name}" in text
        (tmp_path / ours).touch(0o600)
        (tmp_path / ours).write_bytes((TLS / ours).read_bytes())
        text = text.replace(f"/etc/ual/{name}", str(tmp_path / ours))
    file.write_text(text, encoding="utf-8")
    assert refused_configurations([["--config", str(file)]]) == []


# --- Programs and excerpts --------------------------------------------------------------------------------------------


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


def test_the_excerpts_of_write_a_backend_are_the_example() -> None:
    engine = ROOT / "ual_daemon" / "backends" / "engine"
    sources = HOVER / "ual_hover" / "backend.py", engine / "reporting.py"
    code = "".join(each.read_text(encoding="utf-8") for each in sources)
    *first, program = blocks(DOCS / "how-to" / "write-a-backend.md", "python")
    excerpts = [*first, *blocks(DOCS / "reference" / "backend-interface.md", "python")]
    assert len(excerpts) >= 5
    for excerpt in excerpts:
        assert excerpt in code
    assert "conformance.run" in program  # tests/examples runs it
    [entry_point] = blocks(DOCS / "how-to" / "write-a-backend.md", "toml")
    assert entry_point in (HOVER / "pyproject.toml").read_text(encoding="utf-8")


def test_the_excerpts_of_write_an_extension_are_the_example() -> None:
    code = "".join((ARM / "ual_arm" / f"{name}.py").read_text(encoding="utf-8") for name in ("extension", "client"))
    excerpts = blocks(DOCS / "how-to" / "write-an-extension.md", "python")
    assert len(excerpts) >= 4
    for excerpt in excerpts:
        assert excerpt in code
    [entry_point] = blocks(DOCS / "how-to" / "write-an-extension.md", "toml")
    assert entry_point in (ARM / "pyproject.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "program", blocks(DOCS / "reference" / "backends" / "light.md", "python"), ids=["stepped", "several"]
)
def test_the_programs_of_the_light_backends_page_run(program: str) -> None:
    done = subprocess.run([sys.executable, "-W", "error", "-c", program], capture_output=True, text=True, timeout=100.0)
    assert done.returncode == 0, done.stderr


def run(program: str, **names: object) -> None:
    exec(compile(program, "a program of the page", "exec"), {"__name__": "page", **names})


def test_the_programs_of_the_python_clients_page_run(daemon: DaemonProcess) -> None:
    programs = blocks(DOCS / "reference" / "clients" / "python.md", "python")
    whole = [program for program in programs if "import ual" in program and "ual.Team" not in program]
    in_process = [program for program in programs if "import UAL" in program]
    parts = [program for program in programs if "import ual" not in program and program not in in_process]
    assert (len(whole), len(in_process), len(parts)) == (2, 1, 8)
    run(in_process[0])
    armed = daemon.wait_for("state", new="LANDED_ARMED")
    for program in whole:  # each takes off and lands, which ends disarmed
        run(program)
        disarmed = daemon.wait_for("state", new="LANDED_DISARMED", after=armed)
        armed = daemon.wait_for("state", new="LANDED_ARMED", after=disarmed)
    with ual.Uav(daemon.ns) as uav:
        uav.take_off(3.0)
        uav.add_frame(ual.Transform(ual.Vector3(5.0, 5.0, 0.0), frame_id="map", child_frame_id="car/base_link"))
        for program in parts[:-1]:
            run(program, uav=uav, ual=ual)
        uav.land()
        run(parts[-1], uav=uav)  # the safety pilot arms, the link is lost


def test_the_team_of_the_python_clients_page_flies(start_daemon: StartDaemon) -> None:
    fleet = start_daemon("--fleet", "2", "--auto-arm", "--set", "light.speed_factor=10")
    for name in ("uav_1", "uav_2"):
        fleet.wait_for("state", ns=name, new="LANDED_ARMED")
    (program,) = (each for each in blocks(DOCS / "reference" / "clients" / "python.md", "python") if "ual.Team" in each)
    run(program)


# --- Tables that must be complete -------------------------------------------------------------------------------------


def test_the_settings_of_the_light_backend_are_all_listed_with_their_defaults() -> None:
    page = (DOCS / "reference" / "backends" / "light.md").read_text(encoding="utf-8")
    listed = dict(re.findall(r"^\| `(\w+)` \| (.+?) \| ", page.split("## Settings")[1], re.MULTILINE))
    defaults = msgspec.to_builtins(LightSettings())
    assert listed.pop("cameras") == "one that looks down"
    del defaults["cameras"]  # docs/how-to/cameras.md lists their settings
    assert listed.pop("gimbals") == "one without a camera"
    del defaults["gimbals"]  # docs/how-to/gimbals.md lists their settings
    assert listed == {
        name: str(list(value) if isinstance(value, (list, tuple)) else value) for name, value in defaults.items()
    }


def test_every_key_of_the_configuration_is_listed() -> None:
    sections = (
        DaemonSettings,
        VehicleSettings,
        GeofenceSettings,
        LimitSettings,
        FrameSettings,
        ToleranceSettings,
        PayloadSettings,
    )
    keys = {field for section in sections for field in section.__struct_fields__}
    documents = ("reference/configuration.md", "concepts/limits-and-fences.md")
    words = {word for path in documents for span in read(DOCS / path).spans for word in span.split()}
    assert keys - words == set()


def test_every_error_has_a_heading_with_its_reason() -> None:
    text = (DOCS / "reference" / "errors.md").read_text(encoding="utf-8")
    listed = {name: reason for reason, name in re.findall(r"^## ([A-Z_]+)\n\n`(\w+)`", text, re.MULTILINE)}
    raised = {
        name: kind for name, kind in inspect.getmembers(errors, inspect.isclass) if issubclass(kind, errors.UalError)
    }
    assert listed == {name: kind.reason for name, kind in raised.items()}


def test_who_or_what_ends_a_task_is_listed() -> None:
    """Commands that replace a task are listed by three of them."""
    text = (DOCS / "reference" / "errors.md").read_text(encoding="utf-8").split("| `by` |")[1].split("\n\n")[0]
    listed = {
        name for cell in re.findall(r"^\| (`.+?) \|", text, re.MULTILINE) for name in re.findall(r"`(.+?)`", cell)
    }
    code = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "ual_daemon").rglob("*.py"))
    literals = set(re.findall(r'"by": "(.+?)"', code))
    causes = {cause.value for cause in Cause if cause.value} | {trouble.value for trouble in Trouble}
    assert listed - {"go_to_waypoint", "set_velocity", "abort"} == literals | causes | {"cancel"}


def test_what_follows_from_the_code_is_up_to_date() -> None:
    assert out_of_date() == []


def test_every_event_of_the_log_that_is_listed_exists() -> None:
    text = (DOCS / "reference" / "log.md").read_text(encoding="utf-8").split("| event |")[1]
    listed = [
        name for cell in re.findall(r"^\| (`.+?) \|", text, re.MULTILINE) for name in re.findall(r"`(\w+)`", cell)
    ]
    code = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "ual_daemon").rglob("*.py"))
    assert len(listed) >= 15
    assert [name for name in listed if f'"{name}"' not in code] == []


def test_every_test_that_a_page_names_exists() -> None:
    tests = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py"))
    known = {*re.findall(r"def (test_\w+)", tests), *(path.stem for path in (ROOT / "tests").rglob("test_*.py"))}
    named = {name for path in DOCS.rglob("*.md") for name in re.findall(r"`(test_\w+)`", path.read_text("utf-8"))}
    assert len(named) > 50
    assert named - known == set()


def test_every_decision_is_listed_with_its_title() -> None:
    folder = DOCS / "evidence" / "decisions"
    text = (folder / "README.md").read_text(encoding="utf-8")
    titles = {path.name: path.read_text(encoding="utf-8").splitlines()[0] for path in folder.glob("0*.md")}
    assert {name: f"# {title}" for title, name in re.findall(r"^- \[(.+)\]\((.+)\)$", text, re.MULTILINE)} == titles
