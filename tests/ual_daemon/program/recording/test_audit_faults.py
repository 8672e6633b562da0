"""An audit whose disk is full, or whose file is gone, is told, goes on, and where it is required keeps UAVs down."""

from __future__ import annotations

import errno
import json
import os
import resource
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import ual
import ual.v1.ual_pb2
from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon
from tests.ual_daemon.program.metrics.scraped import scraped
from tests.ual_daemon.stepped import stepped
from tests.waiting import until
from ual import Pose, State, Twist, Vector3
from ual.access import audit as chain
from ual_daemon.program.recording import audit_file, audit_writer
from ual_daemon.program.recording.audit import Audit
from ual_daemon.program.recording.audit_file import AuditFile
from ual_daemon.server.call_log import CallRecord
from ual_daemon.server.motion_gate import FLIES
from ual_tools.main import cli

FLYING = ("--auto-arm", "--set", "light.speed_factor=10", "--metrics", "127.0.0.1:0")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "audit.jsonl"


def entries(*files: Path) -> list[dict[str, Any]]:
    """The lines of files, each of which is a whole chain."""
    found = []
    for file in files:
        lines = file.read_bytes().splitlines()
        chain.verify(lines)
        found += [json.loads(line) for line in lines]
    return found


def verified(file: Path) -> str:
    """Returns the output of the command about a file that is whole."""
    result = CliRunner().invoke(cli, ["audit", "verify", str(file)])
    assert result.exit_code == 0, result.output
    return result.output


@contextmanager
def without_space(daemon: DaemonProcess, file: Path, space_bytes: int = 0) -> Iterator[None]:
    """The daemon's files cannot grow beyond what the audit has now, and so many bytes."""
    before = resource.prlimit(daemon.pid, resource.RLIMIT_FSIZE)
    resource.prlimit(daemon.pid, resource.RLIMIT_FSIZE, (file.stat().st_size + space_bytes, before[1]))
    try:
        yield
    finally:
        resource.prlimit(daemon.pid, resource.RLIMIT_FSIZE, before)


def checks(uav: ual.Uav) -> str:
    health = uav.telemetry().health
    return "" if health is None else "; ".join(each for each in health.failing_checks if each.startswith("daemon: "))


def until_checks(uav: ual.Uav, text: str) -> None:
    """Waits until the checks of the daemon that fail have a text; an empty one: until none fails."""
    until(lambda: text in checks(uav) if text else not checks(uav))


def metric(daemon: DaemonProcess, name: str) -> float:
    return scraped(str(daemon.wait_for("metrics")["address"]))(name)


def end(daemon: DaemonProcess) -> None:
    daemon.signal(signal.SIGTERM)
    assert daemon.wait() == 0


def test_without_its_audit_nothing_flies_and_what_ends_a_flight_does(start_daemon: StartDaemon, file: Path) -> None:
    daemon = start_daemon(*FLYING, "--audit", str(file), "--audit-required")
    with ual.Uav(address=daemon.address) as uav:
        uav.wait_for(State.LANDED_ARMED, timeout_s=LIMIT_S)
        uav.take_off(3.0)
        uav.set_velocity(Twist(Vector3(0.2, 0.0, 0.0)))
        with without_space(daemon, file, space_bytes=10):
            uav.abort()  # its line does not fit any more
            failed = daemon.wait_for("audit_fails")
            until(lambda: "cannot be written: File too large" in checks(uav))
            assert metric(daemon, "ual_audit_writable") == 0.0
            for command in (
                lambda: uav.go_to_waypoint(Pose.at(2.0, 0.0, 3.0)),
                lambda: uav.set_velocity(Twist(Vector3(0.5, 0.0, 0.0))),
                lambda: uav.set_pose(Pose.at(1.0, 0.0, 3.0)),
                uav.return_to_launch,
                uav.recover_from_manual,
            ):
                with pytest.raises(ual.WrongStateError, match=r"audit cannot be written \(File too large") as caught:
                    command()
                assert caught.value.metadata["needed"] == "audit"
            uav.abort()
            with uav.lease("pilot"):
                uav.land()
            with pytest.raises(ual.WrongStateError, match="--audit-required"):
                uav.take_off(3.0)
        daemon.wait_for("audit_resumes", after=failed)
        until(lambda: not checks(uav))
        assert metric(daemon, "ual_audit_writable") == 1.0
        uav.wait_for(State.LANDED_ARMED, timeout_s=LIMIT_S)
        uav.take_off(3.0)
        uav.land()
    end(daemon)
    assert "it could not be written 1 time(s): File too large" in verified(file)
    assert "incomplete" not in verified(file)
    found = entries(file)
    refused = [each for each in found if each.get("reason") == "WRONG_STATE"]
    assert [each["method"].rpartition("/")[2] for each in refused] == [
        *("GoToWaypoint", "SetVelocity", "SetPose", "ReturnToLaunch", "RecoverFromManual", "TakeOff")
    ]
    assert sum(each.get("method", "").endswith("/Land") and each["event"] == "ended" for each in found) == 2


def test_each_worker_of_a_fleet_learns_of_it(start_daemon: StartDaemon, file: Path) -> None:
    fleet = ("--fleet", "2", "--workers", "2", "--auto-arm", "--metrics", "127.0.0.1:0")
    daemon = start_daemon(*fleet, "--audit", str(file), "--audit-required")
    daemon.wait_for("serving")
    with ual.Uav("uav_1") as first, ual.Uav("uav_2") as second:
        first.wait_for(State.LANDED_ARMED, timeout_s=LIMIT_S)
        second.wait_for(State.LANDED_ARMED, timeout_s=LIMIT_S)
        with without_space(daemon, file):
            first.set_home()
            for uav in (first, second):
                until_checks(uav, "cannot be written")
                with pytest.raises(ual.WrongStateError, match="File too large"):
                    uav.take_off(3.0)
        for uav in (first, second):
            until_checks(uav, "")
            uav.take_off(3.0, blocking=False)
        address = str(daemon.wait_for("metrics")["address"])
        assert scraped(address)("ual_audit_writable", process="supervisor") == 1.0
    end(daemon)
    verified(file)


def test_it_needs_a_file(start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--audit-required", listen="127.0.0.1:0")
    assert daemon.wait() == 2
    assert "--audit-required: which file? Give --audit FILE, too" in daemon.stderr


def test_what_flies_is_known_by_name() -> None:
    of_uav = {"Arm", "TakeOff", "GoToWaypoint", "GoToWaypointGeo", "FollowPath", "ReturnToLaunch", "SetPose"}
    of_uav |= {"SetVelocity", "StreamSetpoints", "RecoverFromManual", "Resume"}
    of_missions = {f"/ual.v1.MissionService/{name}" for name in ("StartMission", "ResumeMission", "JumpToItem")}
    assert {f"/ual.v1.UalService/{name}" for name in of_uav} | of_missions == FLIES


def remove(file: Path) -> None:
    file.unlink()


def move(file: Path) -> None:
    file.rename(file.with_suffix(".old"))


def replace(file: Path) -> None:
    other = file.with_suffix(".other")
    other.touch()
    other.replace(file)


def remove_directory(file: Path) -> None:
    moved = file.parent.with_name("moved")
    file.parent.rename(moved)
    file.parent.mkdir()


@pytest.mark.parametrize(
    ("lose", "why"),
    [(remove, "removed"), (move, "moved"), (replace, "replaced"), (remove_directory, "moved")],
)
def test_a_file_that_is_gone_is_begun_anew_before_anybody_calls(
    start_daemon: StartDaemon, tmp_path: Path, lose: Callable[[Path], None], why: str
) -> None:
    (tmp_path / "audits").mkdir()
    file = tmp_path / "audits" / "audit.jsonl"
    daemon = start_daemon(*FLYING, "--audit", str(file))
    with ual.Uav(address=daemon.address) as uav:
        uav.set_home()
        until(lambda: b"SetHome" in file.read_bytes())
        lose(file)
        event = daemon.wait_for("audit_file_lost")
        assert why in event["why"]
        assert event["level"] == "error"
        until(lambda: f"was {why}" in checks(uav))
        assert metric(daemon, "ual_audit_file_losses_total") == 1.0
        uav.add_frame(ual.Transform(Vector3(1.0, 0.0, 0.0), child_frame_id="tower"))
    end(daemon)
    opened, called = entries(file)
    assert why in opened["after"]
    assert called["method"] == "/ual.v1.UalService/AddFrame"
    assert f"it begins after another file of the same name: that one was {why}" in verified(file)


def test_a_directory_that_is_gone_is_a_failure_until_it_is_back(start_daemon: StartDaemon, tmp_path: Path) -> None:
    (tmp_path / "audits").mkdir()
    file = tmp_path / "audits" / "audit.jsonl"
    daemon = start_daemon(*FLYING, "--audit", str(file), "--audit-required")
    with ual.Uav(address=daemon.address) as uav:
        uav.wait_for(State.LANDED_ARMED, timeout_s=LIMIT_S)
        file.parent.rename(tmp_path / "moved")
        daemon.wait_for("audit_fails")
        until(lambda: "No such file or directory" in checks(uav))
        with pytest.raises(ual.WrongStateError, match="No such file or directory"):
            uav.take_off(3.0)
        file.parent.mkdir()
        daemon.wait_for("audit_resumes")
        until(lambda: "cannot be written" not in checks(uav))
        uav.take_off(3.0, blocking=False)
    end(daemon)
    taken_off = [each for each in entries(file) if each.get("method", "").endswith("TakeOff")]
    assert taken_off[0]["reason"] == "WRONG_STATE"


# --- The writer by itself ---------------------------------------------------------------------------------------------


class Disk:
    """Writes for the audit, unless it is full."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.is_full = False
        self.tried = threading.Event()
        self._write = os.write
        monkeypatch.setattr(f"{audit_file.__name__}.os.write", self.write)

    def write(self, to: int, data: bytes) -> int:
        if not self.is_full:
            return self._write(to, data)
        self.tried.set()
        raise OSError(errno.ENOSPC, "No space left on device")


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    monkeypatch.setattr(audit_writer, "_RETRY_S", 0.01)
    return Disk(monkeypatch)


def record(number: int, request: bytes = b"", method: str = "Land") -> CallRecord:
    return CallRecord(number, f"/ual.v1.UalService/{method}", "ipv4:127.0.0.1:5", "local", "it", 0, 1, True, request, 1)


def test_large_requests_wait_in_bounded_number(file: Path, disk: Disk) -> None:
    with stepped() as uav:
        it = Audit(AuditFile(file))
        disk.is_full = True
        it.put_call(uav.vehicle, record(0), None)
        assert disk.tried.wait(LIMIT_S)
        until(lambda: it.trouble != "")
        for number in range(1, 101):
            it.put_call(uav.vehicle, record(number, bytes(4 << 20)), None)
        assert it.figures.size_bytes <= 64 << 20
        assert it.figures.lost_count == 84
        disk.is_full = False
        until(lambda: it.figures.entries_count == 0)
        it.close()
    found = entries(file)
    assert [each["lines"] for each in found if each["event"] == "lost"] == [84]
    assert "84 LINES ARE MISSING" in verified(file)


def test_a_row_is_never_so_long_that_the_next_daemon_takes_the_file_for_none(file: Path) -> None:
    with stepped() as uav:
        it = Audit(AuditFile(file))
        name = "\x01" * (3 << 20)  # six times as long in JSON
        request = ual.v1.ual_pb2.RemoveFrameRequest(frame_id=name).SerializeToString()
        it.put_call(uav.vehicle, record(1, request, "RemoveFrame"), None)
        it.close()
    Audit(AuditFile(file)).close()
    [_, called, _] = entries(file)
    assert (called["method"], called["identity"]) == ("/ual.v1.UalService/RemoveFrame", "local")
    assert "bytes" in called["untold"]
    assert "1 of them without content" in verified(file)


def test_an_entry_that_cannot_be_made_has_a_row_in_its_position(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    def fail() -> dict[str, Any]:
        raise OverflowError("a defect")

    it = Audit(AuditFile(file))
    it.put(fail)
    it.put(lambda: {"event": "ended", "value": b"no JSON"})
    it.put(lambda: {"event": "ended"})
    it.close()
    assert [each["event"] for each in entries(file)] == ["opened", "untold", "untold", "ended"]
    assert entries(file)[1]["why"] == "OverflowError: a defect"
    assert "2 of them without content" in verified(file)
    assert {each.levelname for each in caplog.records if each.name == "ual.shared.guard"} == {"ERROR"}


def test_a_full_disk_at_the_end_leaves_no_part_of_a_row(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(audit_writer, "_RETRY_S", 0.01)
    written = os.write
    it = Audit(AuditFile(file))

    def write(to: int, data: bytes) -> int:
        if len(data) > 20:
            return written(to, data[:20])  # a part still fits
        raise OSError(errno.ENOSPC, "No space left on device")

    with stepped() as uav:
        monkeypatch.setattr(f"{audit_file.__name__}.os.write", write)
        it.put_call(uav.vehicle, record(1), None)
        it.close()
    assert [each["event"] for each in entries(file)] == ["opened"]
    assert verified(file).startswith("whole: 1 lines; the last hash")


def test_a_disk_without_space_is_trouble_before_anything_is_written(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    it = Audit(AuditFile(file))
    assert it.trouble == ""
    monkeypatch.setattr(f"{audit_file.__name__}.output_file.has_space", lambda *_: False)
    until(lambda: it.trouble == "No space left on device")
    it.put(lambda: {"event": "ended"})  # what still fits is written
    it.close()
    assert [each["event"] for each in entries(file)] == ["opened", "ended"]


def test_a_disk_that_does_not_answer_is_trouble_until_it_does(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a network, or at its end: a write neither ends nor fails. Motions were accepted, which nothing recorded."""
    now_s, is_asked, answers = [1000.0], threading.Event(), threading.Event()
    it = Audit(AuditFile(file), clock=lambda: now_s[0])
    write = os.write

    def hang(to: int, data: bytes) -> int:
        is_asked.set()
        assert answers.wait(LIMIT_S)
        return write(to, data)

    monkeypatch.setattr(f"{audit_file.__name__}.os.write", hang)
    it.put(lambda: {"event": "ended"})
    assert is_asked.wait(LIMIT_S)
    assert it.trouble == ""
    now_s[0] += 5.1
    told: list[str] = []
    it.on_change = lambda: told.append(it.trouble)
    assert it.trouble == "the disk does not answer"
    answers.set()
    until(lambda: told == [""])
    it.close()
    assert [each["event"] for each in entries(file)] == ["opened", "ended"]
