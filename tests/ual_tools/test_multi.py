"""``ual --ns uav_1,uav_3`` and ``ual --all``: one command for several UAVs."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
import time
from datetime import datetime, timedelta, timezone
from types import SimpleNamespace

import click
import pytest
from click.testing import CliRunner, Result

import ual
from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon
from tests.waiting import until
from ual.simulation import BatteryLow
from ual.types import State
from ual_tools import condition, start
from ual_tools.condition import Urgency
from ual_tools.main import cli
from ual_tools.session import CommandSession
from ual_tools.start import Time, parsed

TEAM = ("uav_1", "uav_2", "uav_3")


@pytest.fixture
def fleet(start_daemon: StartDaemon, monkeypatch: pytest.MonkeyPatch) -> DaemonProcess:
    """Three armed light UAVs in one process."""
    for name in ("UAL_NS", "UAL_ADDRESS", "UAL_TLS_CA"):
        monkeypatch.delenv(name, raising=False)
    daemon = start_daemon("--fleet", "3", "--auto-arm", "--set", "light.speed_factor=10")
    for name in TEAM:
        daemon.wait_for("state", ns=name, new="LANDED_ARMED")
    return daemon


def run(*words: str) -> Result:
    return CliRunner().invoke(cli, words)


def states() -> list[State]:
    with ual.Team(TEAM) as team:
        return list(team.state().values())


def test_all_fly_and_each_has_a_row(fleet: DaemonProcess) -> None:
    del fleet
    result = run("--all", "takeoff", "3")
    assert result.exit_code == 0, result.output
    lines = sorted(result.stdout.splitlines())
    assert [line.split(": ")[0] for line in lines] == list(TEAM)
    assert all("TAKE_OFF SUCCEEDED" in line for line in lines)
    assert states() == [State.FLYING_AUTO] * 3


def test_those_that_are_named_fly_and_the_exit_status_tells_of_a_refusal(fleet: DaemonProcess) -> None:
    del fleet
    assert run("--ns", "uav_1,uav_3", "takeoff", "3").exit_code == 0
    assert states() == [State.FLYING_AUTO, State.LANDED_ARMED, State.FLYING_AUTO]
    result = run("land", "--all")
    assert result.exit_code == 0
    first, second, third = result.stdout.splitlines()
    assert second == "uav_2: stands on the ground already (LANDED_ARMED)"
    assert first.startswith("uav_1: LAND SUCCEEDED")
    assert third.startswith("uav_3: LAND SUCCEEDED")
    assert run("--all", "goto", "1", "1", "3").exit_code == 1


def test_what_each_has_reached_already_is_done(start_daemon: StartDaemon) -> None:
    start_daemon("--fleet", "2").wait_for("state", ns="uav_2", new="LANDED_DISARMED")
    for command in ("disarm", "abort", "land"):
        result = run("--all", command)
        assert result.exit_code == 0
        assert [line.partition(": ")[2] for line in result.stdout.splitlines()] == [
            "stands on the ground already (LANDED_DISARMED)"
        ] * 2
    assert run("--ns", "uav_1", "disarm").exit_code == 1  # a single one may be another than was meant
    assert run("--ns", "uav_1", "arm").exit_code == 0
    result = run("--all", "arm")
    assert result.exit_code == 0
    assert result.stdout.splitlines() == ["uav_1: stands on the ground already (LANDED_ARMED)", "uav_2: armed"]


def test_each_result_is_an_object_with_the_name(fleet: DaemonProcess) -> None:
    del fleet
    found = [json.loads(line) for line in run("--json", "--all", "state").stdout.splitlines()]
    assert sorted((each["ns"], each["state"]) for each in found) == [(name, "LANDED_ARMED") for name in TEAM]
    assert [each["ns"] for each in found] == list(TEAM)
    found = [json.loads(line) for line in run("--json", "--all", "pause").stdout.splitlines()]
    assert [(each["ns"], each["error"]["reason"]) for each in found] == [(name, "WRONG_STATE") for name in TEAM]
    found = [json.loads(line) for line in run("--json", "--all", "rtl").stdout.splitlines()]
    assert [(each["ns"], each["done"], each["state"]) for each in found] == [(n, "rtl", "LANDED_ARMED") for n in TEAM]


def test_the_worst_comes_first_in_each_list_with_its_battery(fleet: DaemonProcess) -> None:
    del fleet
    with ual.Uav("uav_3") as uav:
        uav.simulation.begin_fault(BatteryLow(9.0))
        until(lambda: condition.of_telemetry(uav.telemetry()).level is Urgency.ALARM)
    rows = [line.split("\t") for line in run("list").stdout.splitlines()]
    assert [row[0] for row in rows] == ["uav_3", "uav_1", "uav_2"]
    assert rows[0][5].endswith(" % CRITICAL")
    assert rows[1][5].endswith(" %")
    found = [json.loads(line) for line in run("--json", "list").stdout.splitlines()]
    assert [(each["ns"], each["level"]) for each in found] == [("uav_3", "ALARM"), ("uav_1", "FINE"), ("uav_2", "FINE")]
    assert 0.0 <= found[0]["battery_percent"] <= 9.0
    assert found[0]["wrong"].startswith("battery ")
    lines = run("--all", "state").stdout.splitlines()
    assert lines == [f"{ns}: LANDED_ARMED" for ns in ("uav_3", "uav_1", "uav_2")]
    watched = run("--all", "watch", "--once").stdout
    assert [line.split("\t")[0] for line in watched.splitlines()] == ["uav_3", "uav_1", "uav_2"]
    assert watched.count(" % CRITICAL") == 1
    assert watched.count(" in map") == 3


def test_where_one_cannot_be_reached_nothing_is_sent(fleet: DaemonProcess) -> None:
    del fleet
    result = run("--ns", "uav_1,uav_2,uav_9", "takeoff", "3")
    assert result.exit_code == 1
    assert "uav_9: DAEMON_UNREACHABLE" in result.stderr
    assert result.stderr.count("nothing was sent, because not all of them can be reached") == 2
    assert states() == [State.LANDED_ARMED] * 3


def test_those_that_can_be_reached_land(fleet: DaemonProcess) -> None:
    del fleet
    assert run("--all", "takeoff", "3").exit_code == 0
    result = run("--ns", "uav_1,uav_2,uav_3,uav_9", "land")
    assert result.exit_code == 1
    assert "uav_9: DAEMON_UNREACHABLE" in result.stderr
    assert set(states()) <= {State.LANDED_ARMED, State.LANDED_DISARMED}


def test_goals_are_in_the_frame_of_each(fleet: DaemonProcess) -> None:
    del fleet
    assert run("--all", "takeoff", "3").exit_code == 0
    assert run("--all", "goto", "2", "0", "3").exit_code == 0
    assert run("--all", "goto", "1", "0", "0", "--frame", "{ns}/base_link").exit_code == 0
    with ual.Team(TEAM) as team:
        assert [round(pose.pose.position.x) for pose in team.pose().values()] == [3, 3, 3]
    result = run("--all", "goto", "1", "0", "3", "--frame", "map")
    assert result.exit_code == 2
    assert "leads all of them to one place" in result.stderr


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("--all", "--ns", "uav_1", "land"), "leave out --ns"),
        (("--ns", "uav_1,uav_1", "land"), "name each UAV once"),
        (("--all", "--address", "127.0.0.1:1", "land"), "name those of a gateway: --ns uav_1,uav_2"),
        (("--all", "goto-geo", "37", "-6", "20"), "ual goto-geo is for one UAV at a time"),
        (("--all", "goto", "1", "1", "1", "--plot", "a.png"), "--plot draws one UAV"),
        (("--at", "yesterday", "land"), "is no time"),
        (("--at", "٠٩:٠٠", "land"), "is no time"),
        (("--at", "2020-01-01T00:00:00Z", "land"), "has passed"),
    ],
)
def test_what_makes_no_sense_is_wrong_usage(fleet: DaemonProcess, words: tuple[str, ...], why: str) -> None:
    del fleet
    result = run(*words)
    assert (result.exit_code, why in result.stderr) == (2, True), result.stderr


def test_several_at_one_address_are_those_of_a_gateway_and_never_another(fleet: DaemonProcess) -> None:
    del fleet
    with ual.Uav("uav_1") as uav:
        address = uav.address  # of a daemon, not of a gateway: it is one of them
    result = run("--ns", "uav_1,uav_2", "--address", address, "state")
    assert result.exit_code == 1
    assert "uav_1: LANDED_ARMED" in result.stdout
    assert "uav_2: " in result.stderr
    result = run("--ns", "uav_1,uav_2", "--address", address, "takeoff", "3")
    assert result.exit_code == 1
    assert "uav_1: DAEMON_UNREACHABLE: nothing was sent" in result.stderr
    assert states() == [State.LANDED_ARMED] * 3
    assert "--address (UAL_ADDRESS) is not listed" in run("--address", address, "list").stderr
    lines = run("--ns", "uav_1,uav_2", "--address", address, "watch", "--once")
    assert lines.stdout.count("LANDED_ARMED") == 1


def test_no_daemon_is_reported(start_daemon: StartDaemon) -> None:
    del start_daemon
    result = run("--all", "land")
    assert result.exit_code == 1
    assert "no daemon runs on this computer" in result.stderr


def test_a_time_to_begin_is_kept(fleet: DaemonProcess) -> None:
    begin_s = time.time() + 1.5
    text = datetime.fromtimestamp(begin_s, timezone.utc).isoformat()
    assert run("--all", "--at", text, "takeoff", "3").exit_code == 0
    for name in TEAM:
        line = fleet.wait_for("state", ns=name, new="TAKING_OFF")
        assert datetime.fromisoformat(line["time"].replace("Z", "+00:00")).timestamp() >= begin_s - 0.001


@pytest.mark.parametrize(
    ("now", "text", "begin"),
    [
        ("2026-11-25T10:10:00", "10:15", "2026-11-25T10:15:00"),
        ("2026-11-25T10:10:00", "9:00", "2026-11-25T09:00:00"),  # has passed, and is not tomorrow's
        ("2026-11-25T23:59:30", "0:05:30", "2026-11-26T00:05:30"),
        ("2026-11-25T22:00:00", "06:00", "2026-11-26T06:00:00"),
        ("2026-11-26T00:05:00", "23:59", "2026-11-25T23:59:00"),  # has passed, and is not that of 24 h later
        ("2026-11-25T08:00:00", "21:30", "2026-11-25T21:30:00"),
        ("2026-11-25T10:10:00", "+5", "2026-11-25T10:10:05"),
    ],
)
def test_a_time_of_the_day_is_todays_and_around_midnight_the_nearest_one(now: str, text: str, begin: str) -> None:
    assert parsed(text, datetime.fromisoformat(now)) == datetime.fromisoformat(begin).timestamp()


def test_a_time_of_the_day_that_has_passed_is_refused_with_that_of_the_next_day() -> None:
    passed = datetime.now().astimezone() - timedelta(hours=1)
    with pytest.raises(click.BadParameter, match=r"has passed 1 h 0 min ago; for the next one write") as refused:
        Time().convert(passed.strftime("%H:%M:%S"), None, None)
    following = str(refused.value).split("write ")[1]
    assert datetime.fromisoformat(following) == passed.replace(microsecond=0) + timedelta(days=1)


def test_a_long_wait_is_reported_and_again_when_half_of_it_has_passed(monkeypatch: pytest.MonkeyPatch) -> None:
    clock_s = [0.0]
    told: list[str] = []
    monkeypatch.setattr(start, "time", SimpleNamespace(time=lambda: clock_s[0]))

    class Passing(threading.Event):
        def wait(self, timeout: float | None = None) -> bool:
            assert timeout is not None
            clock_s[0] += timeout
            return False

    monkeypatch.setattr(start, "threading", SimpleNamespace(Event=Passing))
    start.wait_until(3600.0, told.append)
    assert [text.split(", in ")[1] for text in told[:4]] == ["1 h 0 min", "30 min 0 s", "15 min 0 s", "7 min 30 s"]
    assert len(told) == 9


@pytest.mark.parametrize("words", [("goto", "500", "0", "3"), ("velocity", "1", "0", "0", "--for", "600")])
def test_ctrl_c_stops_all(fleet: DaemonProcess, words: tuple[str, ...]) -> None:
    del fleet
    assert run("--all", "takeoff", "3").exit_code == 0
    # A shell lets what it starts in the background ignore SIGINT.
    handling = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    code = f"{handling}\nfrom ual_tools.main import main; main()"
    with ual.Team(TEAM) as team:

        def speeds() -> list[float]:
            return [velocity.twist.linear.x for velocity in team.velocity().values()]

        with subprocess.Popen([sys.executable, "-c", code, "--all", *words], stderr=subprocess.DEVNULL) as program:
            until(lambda: min(speeds()) >= 0.5, seen=speeds)
            program.send_signal(signal.SIGINT)
            assert program.wait(LIMIT_S) == 130
        until(lambda: max(speeds()) <= 0.05, seen=speeds)
        assert team.is_idle() == dict.fromkeys(TEAM, True)


def test_watch_takes_all_before_and_behind_the_command(fleet: DaemonProcess) -> None:
    del fleet
    for words in (("--all", "watch", "--once"), ("watch", "--all", "--once")):
        assert run(*words).stdout.count("LANDED_ARMED") == 3


def test_watch_takes_those_that_are_named(fleet: DaemonProcess) -> None:
    del fleet
    lines = run("--ns", "uav_1,uav_3", "watch", "--once").stdout.splitlines()
    assert [line.split("\t")[0] for line in lines] == ["uav_1", "uav_3"]
    result = run("--ns", "uav_1,uav_9", "watch", "--once")
    assert result.exit_code == 1
    assert "no daemon of the name uav_9 runs on this computer" in result.stderr


def test_where_one_ends_before_it_begins_the_others_do_not_wait_for_it(
    fleet: DaemonProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    del fleet
    connect = CommandSession.connect

    def connect_or_fail(session: CommandSession) -> ual.Uav:
        if session.ns == "uav_2":
            raise ZeroDivisionError
        return connect(session)

    monkeypatch.setattr(CommandSession, "connect", connect_or_fail)
    result = run("--all", "takeoff", "3")
    assert isinstance(result.exception, ZeroDivisionError)
    assert result.stderr.count("nothing was sent") == 2
    assert states() == [State.LANDED_ARMED] * 3
