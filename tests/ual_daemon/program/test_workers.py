"""A fleet that several processes fly (``--workers``), which the user sees as one daemon."""

from __future__ import annotations

import json
import math
import os
import signal
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import ual
from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon, daemon_environment
from tests.ports import free_port_of_uav
from tests.ual_daemon.program.refusal import refused
from tests.waiting import until
from ual import discovery
from ual.access import audit as chain
from ual.errors import InvalidArgumentError, WrongStateError
from ual.types import State
from ual_daemon.program import fleet
from ual_daemon.program.configuration import DaemonSettings
from ual_daemon.program.pipes import Pipe
from ual_daemon.settings import ConfigError

FLEET = ("--fleet", "5", "--workers", "2", "--auto-arm", "--set", "light.speed_factor=10")
NAMES = [f"uav_{number}" for number in range(1, 6)]

# --- Parts ------------------------------------------------------------------------------------------------------------


def parts(**settings: object) -> list[range]:
    return fleet.parts(DaemonSettings(**settings))  # type: ignore[arg-type]  # one setting or another


def test_the_parts_of_the_workers_are_as_equal_as_can_be_and_miss_nobody() -> None:
    assert parts(fleet=10, workers=3) == [range(3), range(3, 6), range(6, 10)]
    assert parts(fleet=2, workers=8) == [range(1), range(1, 2)]
    assert parts(fleet=10) == parts(fleet=10, workers=1) == [range(10)]
    assert parts(fleet_url=("a", "b")) == [range(2)]
    assert parts() == [range(1)]


def test_auto_is_a_worker_for_each_processor_that_may_be_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 3, 7})
    assert parts(fleet=9, workers="auto") == [range(3), range(3, 6), range(6, 9)]


def test_what_cannot_be_spread_is_refused() -> None:
    with pytest.raises(ConfigError, match="one UAV is flown by one process"):
        parts(workers=2)
    with pytest.raises(ConfigError, match="share a radio or a simulator"):
        parts(fleet_url=("a", "b"), workers="auto")


def test_a_pipe_gives_whole_pieces_only() -> None:
    pipe = Pipe(b"\0")
    os.write(pipe.writes, b"a line\0two\nlines\0the beg")
    assert pipe.pieces() == ([b"a line", b"two\nlines"], True)
    os.write(pipe.writes, b"inning\0")
    assert pipe.pieces() == ([b"the beginning"], True)
    os.close(pipe.writes)
    assert pipe.pieces() == ([], False)
    os.close(pipe.reads)


# --- The processes ----------------------------------------------------------------------------------------------------


def workers_of(daemon: DaemonProcess) -> dict[int, list[str]]:
    """The UAVs by the process that serves them, once all are armed."""
    for ns in NAMES:
        daemon.wait_for("state", ns=ns, new="LANDED_ARMED")
    found: dict[int, list[str]] = {}
    for each in discovery.list_daemons():
        found.setdefault(each.pid, []).append(each.ns)
    return found


def wait_for_end(pids: list[int]) -> None:
    """Until the processes are gone, or have ended and wait to be reaped."""
    until(lambda: not any(map(is_running, pids)), "the end of the processes", seen=lambda: [*filter(is_running, pids)])


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_the_time_of_all_processes_is_one(start_daemon: StartDaemon) -> None:
    daemon = start_daemon(*FLEET)
    workers_of(daemon)
    with ual.Team(NAMES) as team:

        def times_s() -> set[float]:
            """The times of the first and the last UAV, which are of different processes."""
            return {round(team[ns].telemetry().stamp_s - start_s[ns], 3) for ns in (NAMES[0], NAMES[-1])}

        team[NAMES[0]].simulation.set_speed_factor(0.0)
        start_s = {ns: team[ns].telemetry().stamp_s for ns in NAMES}
        team[NAMES[-1]].simulation.step(0.5)
        team[NAMES[0]].simulation.step(1.5)
        assert times_s() == {2.0}
        for bad in (-1.0, math.nan, 101.0):
            with pytest.raises(InvalidArgumentError, match="speed_factor"):
                team[NAMES[0]].simulation.set_speed_factor(bad)
        team[NAMES[-1]].simulation.set_speed_factor(math.inf)
        with pytest.raises(WrongStateError, match="runs by itself"):
            team[NAMES[0]].simulation.step(0.5)
        until(lambda: min(times_s()) > 4.0, seen=times_s)


def test_the_time_of_those_left_goes_on(start_daemon: StartDaemon) -> None:
    daemon = start_daemon(*FLEET)
    [gone] = [pid for pid, names in workers_of(daemon).items() if NAMES[0] in names]
    with ual.Uav(NAMES[-1]) as uav:
        os.kill(gone, signal.SIGKILL)
        daemon.wait_for("worker_ended")
        uav.simulation.set_speed_factor(0.0)
        begin_s = uav.telemetry().stamp_s
        uav.simulation.step(0.5)
        assert uav.telemetry().stamp_s == pytest.approx(begin_s + 0.5, abs=0.01)


def test_several_processes_fly_one_fleet(start_daemon: StartDaemon) -> None:
    daemon = start_daemon(*FLEET)
    served = daemon.wait_for("serving")
    assert (served["count"], served["uavs"], served["workers"]) == (5, "uav_1 to uav_5", 2)
    assert sorted(workers_of(daemon).values()) == [["uav_1", "uav_2"], ["uav_3", "uav_4", "uav_5"]]
    for number, ns in enumerate(NAMES):
        with ual.Uav(ns) as uav:
            telemetry = uav.telemetry()
            assert telemetry.state is State.LANDED_ARMED
            assert telemetry.transform is not None
            assert tuple(telemetry.transform.translation) == pytest.approx((3.0 * number, 0.0, 0.0))
            uav.take_off(2.0, timeout_s=LIMIT_S)
    daemon.signal(signal.SIGINT)
    assert daemon.wait() == 0
    held = sorted(event["ns"] for event in daemon.events if event.get("event") == "hold_by_autopilot")
    assert held == NAMES
    assert [event["event"] for event in daemon.events if event.get("event") in ("signal", "ended")] == [
        "signal",
        "ended",
    ]
    assert not discovery.list_daemons()


@contextmanager
def taken(port: int) -> Iterator[None]:
    with socket.socket() as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        other.bind(("127.0.0.1", port))
        other.listen()
        yield


@pytest.mark.parametrize("workers", [(), ("--workers", "2")])
def test_a_port_that_is_taken_lets_none_be_served(workers: tuple[str, ...], runtime_dir: Path) -> None:
    port = free_port_of_uav()
    ns = f"uav_{port - 50050 - 3}"
    with taken(port):
        daemon = DaemonProcess(("--fleet", "6", *workers), ns, daemon_environment(runtime_dir))
        assert daemon.wait() == 1
        daemon.close()
    assert daemon.stderr.startswith(
        f"ual-daemon: uav_{port - 50050}: cannot listen on 127.0.0.1:{port}: the port is in"
    )
    assert daemon.events == []
    assert not list(runtime_dir.glob("*.json"))


def test_a_worker_that_dies_is_reported_and_the_others_go_on(start_daemon: StartDaemon) -> None:
    daemon = start_daemon(*FLEET)
    workers = workers_of(daemon)
    lost, left = sorted(workers, key=workers.__getitem__)
    os.kill(lost, signal.SIGKILL)
    told = daemon.wait_for("worker_ended", pid=lost)
    assert (told["how"], told["uavs"], told["count"]) == ("killed by SIGKILL", "uav_1 to uav_2", 2)
    assert [each.ns for each in discovery.list_daemons()] == NAMES[2:]
    with ual.Uav("uav_4") as uav:
        uav.take_off(2.0, timeout_s=LIMIT_S)
    daemon.signal(signal.SIGTERM)
    assert daemon.wait() == 3
    assert not is_running(left)


def test_workers_end_when_the_process_that_started_them_is_killed(start_daemon: StartDaemon) -> None:
    daemon = start_daemon(*FLEET)
    pids = list(workers_of(daemon))
    with ual.Uav("uav_1") as uav:
        uav.take_off(2.0, timeout_s=LIMIT_S)
    daemon.process.kill()
    wait_for_end(pids)
    daemon.wait()
    assert not discovery.list_daemons()
    held = [event["ns"] for event in daemon.events if event.get("event") == "hold_by_autopilot"]
    assert held == ["uav_1"]  # its end was safe, and still logged
    assert sum(event.get("event") == "supervisor_gone" for event in daemon.events) == 2


def test_a_signal_to_all_processes_is_the_first_for_each(start_daemon: StartDaemon) -> None:
    """So does systemd: the supervisor's word must not count as a second signal, which would end a worker at once."""
    daemon = start_daemon(*FLEET)
    pids = list(workers_of(daemon))
    with ual.Uav("uav_5") as uav:
        uav.take_off(2.0, timeout_s=LIMIT_S)
    for pid in (*pids, daemon.pid):
        os.kill(pid, signal.SIGTERM)
    assert daemon.wait() == 0
    daemon.wait_for("hold_by_autopilot", ns="uav_5")


def test_a_second_signal_ends_all_at_once(start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--fleet", "5", "--workers", "2", "--auto-arm")
    pids = list(workers_of(daemon))
    with ual.Uav("uav_1") as uav:
        uav.take_off(100.0, blocking=False)
        daemon.wait_for("state", ns="uav_1", new="TAKING_OFF")
        uav.simulation.set_speed_factor(0.0)  # the first signal waits until the second comes
    daemon.signal(signal.SIGTERM)
    daemon.wait_for("waiting_to_end", ns="uav_1")
    daemon.signal(signal.SIGTERM)
    assert daemon.wait() == 128 + signal.SIGTERM
    wait_for_end(pids)


def test_one_audit_and_a_recording_for_each_worker(start_daemon: StartDaemon, tmp_path: Path) -> None:
    audit, recordings = tmp_path / "audit.jsonl", tmp_path / "recordings"
    daemon = start_daemon(*FLEET, "--audit", str(audit), "--record", str(recordings))
    workers_of(daemon)
    for ns in NAMES:
        with ual.Uav(ns) as uav:
            uav.set_home()
    daemon.signal(signal.SIGTERM)
    assert daemon.wait() == 0
    lines = audit.read_bytes().splitlines()
    chain.verify(lines)  # the chain is whole
    homes = [entry["ns"] for entry in map(json.loads, lines) if entry.get("method", "").endswith("/SetHome")]
    assert sorted(homes) == NAMES  # each process writes when it comes to it
    assert sorted(path.name.rpartition("_")[0] for path in recordings.iterdir()) == ["uav_1", "uav_3"]


@pytest.mark.parametrize(
    ("flags", "expected"),
    [
        (("--fleet", "4", "--set", "light.seed=x"), "ual-daemon: --set light.seed: expected a whole number, got text"),
        (
            ("--fleet", "4", "--backend", "mavlink"),
            "ual-daemon: --fleet: a fleet of autopilots needs a --fleet-url for each",
        ),
        (("--fleet", "20000"), "ual-daemon: --fleet: uav_15486 has no port"),
        ((), "ual-daemon: --workers: one UAV is flown by one process"),
    ],
)
def test_what_a_fleet_cannot_be_is_reported_once(flags: tuple[str, ...], expected: str, runtime_dir: Path) -> None:
    assert refused(("--workers", "2", *flags), daemon_environment(runtime_dir)).startswith(expected)
