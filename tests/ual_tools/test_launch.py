"""``ual launch`` with real processes: light UAVs, and small programs beside them."""

from __future__ import annotations

import asyncio
import os
import re
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any

import pytest
from typing_extensions import Self

import ual
from tests.conftest import LIMIT_S, daemon_environment, open_terminal
from tests.forkserver import start_ual
from tests.waiting import until, until_async
from ual import discovery
from ual.types import State, Telemetry
from ual_daemon.flight import explanation
from ual_tools.launch import flying
from ual_tools.launch.descendants import all_below
from ual_tools.launch.flying import SENDS_NOTHING, Watched
from ual_tools.launch.log import TeamLog
from ual_tools.launch.run import ONE_PRESS_S, Presses
from ual_tools.launch.supervisor import Supervisor
from ual_tools.launch.team import Program, Ready, ReadyCondition, Restart

UAVS = """\
uavs:
  - count: {count}
    listen: 127.0.0.1:0
    home_pose: [0, "{{3*index}}", 0]
    config: {{auto_arm: true, light: {{speed_factor: {speed}}}}}
"""


class Launched:
    """One ``ual launch`` and its log."""

    def __init__(self, file: Path, environment: dict[str, str], terminal: tuple[int, int] | None = None) -> None:
        self.log = ""
        self._changed = threading.Condition()
        self._has_ended = False
        source, its = os.pipe() if terminal is None else terminal
        self._pipe = source if terminal is None else None
        self.process = start_ual(("launch", str(file)), environment, stdout=its, stderr=its)
        os.close(its)
        self._reader = threading.Thread(target=self._read, args=(source,), daemon=True)
        self._reader.start()

    def wait_for(self, pattern: str) -> None:
        """Returns once its log matches."""
        deadline_s = time.monotonic() + LIMIT_S
        with self._changed:
            while not re.search(pattern, self.log):
                left_s = deadline_s - time.monotonic()
                assert left_s > 0.0, f"no {pattern} in:\n{self.log}"
                assert not self._has_ended, f"no {pattern} in:\n{self.log}"
                self._changed.wait(left_s)

    def press_again(self) -> None:
        """Sends Ctrl-C so long after the log has told of the last one that it is another one."""
        time.sleep(1.1 * ONE_PRESS_S)  # what is sooner is the same press
        self.signal(signal.SIGINT)

    def signal(self, number: signal.Signals) -> None:
        self.process.send_signal(number)

    def wait(self) -> int:
        """Its exit status, once it has ended and its whole log is read."""
        status = self.process.wait(LIMIT_S)
        self._reader.join(LIMIT_S)
        return status

    def close(self) -> None:
        below = all_below(self.process.pid)
        self.process.kill()
        self.process.wait(LIMIT_S)
        for pid in below:
            kill(pid)
        self._reader.join(LIMIT_S)
        if self._pipe is not None:
            os.close(self._pipe)

    def _read(self, source: int) -> None:
        while True:
            try:
                data = os.read(source, 65536)
            except OSError:
                data = b""
            with self._changed:
                self.log += data.decode(errors="replace")
                self._has_ended = not data
                self._changed.notify_all()
            if not data:
                return


def kill(pid: int) -> None:
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        return


def runs(pid: int) -> bool:
    """Returns whether there is such a process, and it is no corpse."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


StartTeam = Callable[..., Launched]


@pytest.fixture
def start_team(tmp_path: Path, runtime_dir: Path) -> Iterator[StartTeam]:
    """Runs a file: ``start_team(text, count=2, speed=10, terminal=..., NO_COLOR="1")``."""
    started: list[Launched] = []
    # A suite that is run by `nohup` ignores it; our programs would inherit that.
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

    def start(
        text: str, count: int = 1, speed: float = 10.0, terminal: tuple[int, int] | None = None, **variables: str
    ) -> Launched:
        file = tmp_path / "team.yaml"
        file.write_text(UAVS.format(count=count, speed=speed) + text)
        started.append(Launched(file, {**daemon_environment(runtime_dir), **variables}, terminal))
        return started[-1]

    yield start
    for each in started:
        each.close()


def pid_of(ns: str) -> int:
    found = discovery.registered(ns)
    assert found is not None
    return found.pid


BESIDE = """\
    with:
      - name: first-{index}
        run: [sh, -c, "echo begins; exec 3>first-{index}; exec sleep 1000"]
        ready: {file: "first-{index}"}
      - name: second-{index}
        run: [sh, -c, "test -e first-{index} && (setsid sleep 1000 & ) && echo is up && sleep 1000"]
        ready: {log: is up}
before:
  - name: prepare
    run: [sh, -c, "echo prepared"]
    ready: {exit: true}
after:
  - name: viewer
    run: [sleep, "1000"]
    end: last
  - name: mission
    run: [sleep, "1000"]
"""


def test_ctrl_c_in_flight_lands_all_and_leaves_no_process(start_team: StartTeam) -> None:
    launched = start_team(BESIDE, count=2)
    launched.wait_for("all are ready")
    with ual.Team(["uav_1", "uav_2"]) as team:
        until(lambda: set(team.state().values()) == {State.LANDED_ARMED})
        team.take_off(3.0)
        below = all_below(launched.process.pid)
        assert len(below) >= 2 + 2 * 3 + 2  # daemons, what is beside each, and the left-behind of each; viewer, mission
        launched.signal(signal.SIGINT)
        assert launched.wait() == 0, launched.log
    assert not list(filter(runs, below))
    order = ["prepare: ready", "first-1: ready", "second-1: ready", "uav_1: ready", "viewer: ready", "mission: ready"]
    order += [
        "all are ready",
        "launch *ends",
        "uav_1: lands",
        "new=LANDING",
        "uav_1: stands",
        "program.supervision: ended",
    ]
    places = [re.search(what, launched.log) for what in order]
    assert [place.start() for place in places if place] == sorted(place.start() for place in places if place)
    assert all(places), launched.log
    assert "uav_2: stands" in launched.log
    assert "was left behind: SIGTERM" in launched.log
    assert "\x1b" not in launched.log


def test_a_daemon_that_is_killed_comes_back_and_the_next_command_works(start_team: StartTeam) -> None:
    launched = start_team("")
    launched.wait_for("all are ready")
    with ual.Uav("uav_1") as uav:
        uav.wait_for(State.LANDED_ARMED, timeout_s=LIMIT_S)
    killed = pid_of("uav_1")
    os.kill(killed, signal.SIGKILL)
    launched.wait_for(r"killed by SIGKILL[^$]*starts again[^$]*uav_1: ready")
    assert pid_of("uav_1") != killed
    with ual.Uav("uav_1") as uav:
        uav.wait_for(State.LANDED_ARMED, timeout_s=LIMIT_S)
        uav.take_off(2.0, timeout_s=LIMIT_S)
    launched.signal(signal.SIGTERM)
    assert launched.wait() == 0
    assert "uav_1: stands" in launched.log


def test_a_daemon_that_cannot_start_ends_the_team_with_the_reason(start_team: StartTeam) -> None:
    launched = start_team("    backend: lihgt\nbefore: [{name: world, run: sleep 1000}]\n")
    assert launched.wait() == 1
    assert "lihgt" in launched.log
    assert "the team ends, because of uav_1: ended (exit status 2) before it was ready" in launched.log
    assert "starts again" not in launched.log


def test_the_end_of_the_mission_lands_and_ends_the_team(start_team: StartTeam) -> None:
    mission = f'[{sys.executable}, -c, "from ual_tools.main import main; main()", takeoff, "2"]'
    waiting = f'[{sys.executable}, -c, "from ual_tools.main import main; main()", wait, LANDED_ARMED]'
    launched = start_team(
        f"after:\n- {{name: wait, run: {waiting}, ready: {{exit: true}}}}\n"
        f"- {{name: mission, run: {mission}, ends_team: true}}\n"
    )
    assert launched.wait() == 0, launched.log
    assert "TAKE_OFF SUCCEEDED" in launched.log
    assert "the team ends, because of mission: has ended" in launched.log
    assert "uav_1: stands" in launched.log


DEAF = """\
after:
  - name: deaf
    run: [sh, -c, "trap '' TERM; echo deaf; while :; do sleep 1000; done"]
    ready: {log: deaf}
    end: last
    stop_limit_s: 1000
"""


def test_two_signals_at_once_are_one_ctrl_c() -> None:
    counted: list[int] = []
    times = iter([5.0, 5.01, 9.0, 9.0, 9.2, 12.0])
    presses = Presses(counted.append, lambda: next(times))
    for _ in range(6):
        presses()
    assert counted == [1, 2, 3]


def test_who_presses_ctrl_c_again_and_again_is_received() -> None:
    counted: list[int] = []
    times = iter([5.0, 5.2, 5.4, 5.6, 5.8])
    presses = Presses(counted.append, lambda: next(times))
    for _ in range(5):
        presses()
    assert counted == [1, 2, 3]


def test_a_second_ctrl_c_holds_and_a_third_one_kills(start_team: StartTeam) -> None:
    launched = start_team(DEAF, speed=4.0)
    launched.wait_for("all are ready")
    with ual.Uav("uav_1") as uav:
        uav.wait_for(State.LANDED_ARMED, timeout_s=LIMIT_S)
        uav.take_off(12.0, timeout_s=LIMIT_S)
        uav.simulation.set_speed_factor(0.2)  # the landing lasts
    launched.signal(signal.SIGINT)
    launched.wait_for("new=LANDING")
    launched.press_again()
    launched.wait_for("holds, and ends at once[^$]*uav_1: (holds|does not hold)")
    launched.press_again()
    assert launched.wait() == 1
    assert "uav_1: stands" not in launched.log
    assert "kills all programs" in launched.log


def test_a_launch_that_is_killed_leaves_its_daemons_flying_and_the_next_one_says_so(start_team: StartTeam) -> None:
    launched = start_team("")
    launched.wait_for("all are ready")
    pid = pid_of("uav_1")
    launched.process.kill()
    launched.wait()
    try:
        with ual.Uav("uav_1") as uav:
            uav.wait_for(State.LANDED_ARMED, timeout_s=LIMIT_S)
            uav.take_off(2.0, timeout_s=LIMIT_S)
            assert uav.state() is State.FLYING_AUTO
            again = start_team("")
            assert again.wait() == 1
            assert f"pid {pid}" in again.log
            assert uav.state() is State.FLYING_AUTO
    finally:
        kill(pid)


def test_a_terminal_shows_the_states_below_the_log(start_team: StartTeam) -> None:
    ours, theirs = open_terminal()
    try:
        launched = start_team("", terminal=(ours, theirs), TERM="xterm", COLUMNS="80")
        launched.wait_for(r" uav_1 \S* *LANDED_ARMED")
        launched.signal(signal.SIGHUP)
        assert launched.process.wait(LIMIT_S) == 0
    finally:
        os.close(ours)
    assert "\x1b[" in launched.log


def test_a_terminal_that_is_gone_ends_the_team_in_order(start_team: StartTeam) -> None:
    ours, theirs = open_terminal()
    launched = start_team("", terminal=(ours, theirs), TERM="xterm", COLUMNS="80")
    launched.wait_for("all are ready")
    daemon = pid_of("uav_1")
    os.close(ours)
    launched.signal(signal.SIGHUP)
    assert launched.process.wait(LIMIT_S) == 0
    assert not runs(daemon)


def sample(state: State, reason: str = "in the air") -> Telemetry:
    return Telemetry(state, state_reason=reason)


def test_only_what_ual_flies_is_landed() -> None:
    flown = Watched("uav_1", lambda _: None)
    flown.see(sample(State.FLYING_AUTO, f"OFFBOARD; UAL has not been commanded, and {SENDS_NOTHING}"))
    assert not flown.is_in_control  # a ground station's
    flown.see(sample(State.FLYING_AUTO))
    assert flown.is_in_control
    flown.gone()  # its daemon has died, and is started again
    flown.see(sample(State.UNINITIALIZED))
    flown.see(sample(State.FLYING_AUTO, SENDS_NOTHING))
    flown.see(sample(State.FLYING_MANUAL, "mode AUTO.RTL"))  # the autopilot's failsafe without setpoints
    assert flown.is_in_control
    flown.see(sample(State.FLYING_AUTO))
    flown.see(sample(State.FLYING_MANUAL))
    assert not flown.is_in_control  # the safety pilot has it
    flown.see(sample(State.FLYING_AUTO, SENDS_NOTHING))
    assert not flown.is_in_control
    flown.see(sample(State.LANDING))
    flown.see(sample(State.LANDED_ARMED))
    assert not flown.is_in_control


class TakenClient:
    """A client whose UAV is taken by others while a take-off comes to its end."""

    def __init__(self, state: State) -> None:
        self._state = state
        self.calls: list[str] = []

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        return None

    async def wait_for(self, *_: State, timeout_s: float) -> State:
        del timeout_s
        return self._state

    async def telemetry(self) -> Telemetry:
        return sample(self._state, "mode AUTO.RTL")

    def lease(self, holder: str, *, take: bool) -> TakenClient:
        self.calls.append(f"{holder} takes the lease: {take}")
        return self

    async def land(self, *, timeout_s: float) -> None:
        self.calls.append(f"land within {timeout_s:g} s")


@pytest.mark.parametrize(
    ("state", "why"), [(State.FLYING_MANUAL, "others fly it by now"), (State.LANDED_DISARMED, None)]
)
def test_a_uav_that_others_take_before_it_is_landed_is_theirs(
    state: State, why: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The pilot chooses RTL while a take-off ends: a landing would end that."""
    client = TakenClient(state)
    monkeypatch.setattr(flying, "_client", lambda *_: client)
    flown = Watched("uav_1", lambda _: None)
    flown.see(sample(State.TAKING_OFF))
    assert asyncio.run(flying.land(flown, lambda: "127.0.0.1:1", 120.0)) == why
    assert client.calls == []


def test_the_reason_by_which_a_flight_is_not_ours_is_the_daemons() -> None:
    for reason in (explanation._NOT_COMMANDED, explanation._UNTIL):
        assert SENDS_NOTHING in reason


class RecordedLog(TeamLog):
    """The lines of a log."""

    def __init__(self) -> None:
        super().__init__(["sh"])
        self.lines: list[str] = []

    def write(self, name: str, text: str) -> None:
        self.lines.append(f"{name}: {text}")

    def note(self, text: str, *, is_bad: bool = False) -> None:
        del is_bad
        self.lines.append(text)

    async def until(self, line: str) -> None:
        await until_async(lambda: line in self.lines, line, seen=lambda: self.lines)


def supervised(
    script: str, work: Callable[[Supervisor, RecordedLog], Coroutine[Any, Any, None]], **changes: Any
) -> tuple[Supervisor, list[str]]:
    """A program that is run until `work` has stopped it, or it has ended for good, and the log."""

    async def run() -> tuple[Supervisor, list[str]]:
        log = RecordedLog()
        program = Program(name="sh", **{"argv": ("sh", "-c", script), "cwd": Path("/"), **changes})
        supervisor = Supervisor(program, log)
        await asyncio.wait_for(asyncio.gather(supervisor.run(), work(supervisor, log)), LIMIT_S)
        return supervisor, log.lines

    return asyncio.run(run())


async def nothing(_: Supervisor, __: RecordedLog) -> None:
    pass


async def stop(supervisor: Supervisor, log: RecordedLog) -> None:
    await log.until("sh: ready")
    await supervisor.stop()


def test_a_program_is_ready_when_its_port_is_open() -> None:
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))  # nobody else gets it, and nobody can connect yet
        address = f"127.0.0.1:{bound.getsockname()[1]}"

        async def listen_then_stop(supervisor: Supervisor, log: RecordedLog) -> None:
            await log.until("sh: up")
            assert not supervisor.ready.is_set()
            bound.listen()
            await stop(supervisor, log)

        supervised("echo up; sleep 1000", listen_then_stop, ready=Ready(ReadyCondition.PORT, address))


def test_a_program_that_is_not_ready_in_time_is_ended() -> None:
    supervisor, lines = supervised("sleep 1000", nothing, ready=Ready(ReadyCondition.LOG, "up"), ready_limit_s=0.1)
    assert "sh: not ready after 0.1 s, ended" in lines
    assert "before it was ready" in supervisor.failure
    assert not supervisor.ready.is_set()


def test_a_program_that_cannot_be_found_is_reported() -> None:
    supervisor, _ = supervised("", nothing, argv=("no-such-program",))
    assert "No such file" in supervisor.failure


def test_a_program_that_dies_again_and_again_is_abandoned(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ual_tools.launch.supervisor._PAUSES_S", (0.0, 0.01))
    supervisor, lines = supervised(
        "echo up; exit 4", nothing, ready=Ready(ReadyCondition.LOG, "up"), restart=Restart.ON_FAILURE
    )
    assert lines.count("sh: up") == 3
    assert "sh: starts again in 0.01 s" in lines
    assert supervisor.failure == "it has ended 3 times: given up"


@pytest.mark.parametrize(("restart", "count"), [(Restart.NO, 1), (Restart.ON_FAILURE, 1), (Restart.ALWAYS, 3)])
def test_an_end_that_is_well_is_followed_by_a_start_only_where_that_is_reported(
    monkeypatch: pytest.MonkeyPatch, restart: Restart, count: int
) -> None:
    monkeypatch.setattr("ual_tools.launch.supervisor._PAUSES_S", (0.0, 0.01))
    _, lines = supervised("echo up", nothing, ready=Ready(ReadyCondition.LOG, "up"), restart=restart)
    assert lines.count("sh: up") == count


def test_what_does_not_end_is_killed_after_its_limit(tmp_path: Path) -> None:
    script = "trap '' TERM; echo $$ > pid; echo up; while :; do sleep 1000; done"
    _, lines = supervised(script, stop, cwd=tmp_path, ready=Ready(ReadyCondition.LOG, "up"), stop_limit_s=0.1)
    assert "sh: killed, because it did not end in 0.1 s" in lines
    assert not runs(int((tmp_path / "pid").read_text()))


def test_a_program_is_ended_by_its_own_signal() -> None:
    script = "trap 'echo interrupted; exit 0' INT; echo up; while :; do sleep 0.01; done"
    _, lines = supervised(script, stop, ready=Ready(ReadyCondition.LOG, "up"), stop_signal=signal.SIGINT)
    assert "sh: interrupted" in lines


def test_a_daemon_that_has_to_leave_its_uav_in_motion_is_a_failure(runtime_dir: Path) -> None:
    del runtime_dir
    script = "trap 'exit 3' TERM; echo up; while :; do sleep 0.01; done"
    supervisor, lines = supervised(script, stop, ns="uav_9", ready=Ready(ReadyCondition.LOG, "up"))
    assert supervisor.failure == "ended (exit status 3)"
    assert lines[-1] == "sh: ended (exit status 3)"


def test_its_output_can_go_into_a_file(tmp_path: Path) -> None:
    file = tmp_path / "sh.log"
    _, lines = supervised("echo up; sleep 1000", stop, ready=Ready(ReadyCondition.LOG, "up"), log_file=file)
    assert file.read_text() == "up\n"
    assert "sh: up" not in lines


def test_rows_come_without_what_a_terminal_obeys(capsys: pytest.CaptureFixture[str]) -> None:
    with TeamLog(["px4"]) as log:
        log.write("px4", "\x1b[31mred\x1b[0m \x1b]0;title\x07 \x1b[2J end\r")
    assert capsys.readouterr().out == "px4    red   end\n"


def test_a_pipe_that_is_closed_ends_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "w") as closed:
        monkeypatch.setattr("sys.stdout", closed)
        with TeamLog(["px4"]) as log:
            for _ in range(3):
                log.write("px4", "up")
                log.state("px4", "ready")


def test_a_log_that_nobody_reads_delays_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ual_tools.launch.log._MOST_WAITING_LINES", 10)
    monkeypatch.setattr("ual_tools.launch.log._FLUSH_LIMIT_S", 0.01)
    read, write = os.pipe()
    with os.fdopen(write, "w") as full:
        monkeypatch.setattr("sys.stdout", full)
        with TeamLog(["px4"]) as log:
            for _ in range(1000):
                log.write("px4", "x" * 1000)  # more than the pipe takes
            with os.fdopen(read) as reader:
                while "lines lost" not in (line := reader.readline()):
                    log.write("px4", "y")
        assert "lines lost: the log is not read fast enough" in line
