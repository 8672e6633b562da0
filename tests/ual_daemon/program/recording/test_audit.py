"""The audit of a daemon: each call that changes something, in order, with the caller and the result."""

from __future__ import annotations

import errno
import json
import os
import signal
from pathlib import Path
from typing import Any

import pytest

import ual
from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon
from tests.ual_daemon.stepped import stepped
from ual import Pose, State, Twist, Vector3
from ual.access import audit as chain
from ual_daemon.program.recording import audit_writer
from ual_daemon.program.recording.audit import Audit, changes
from ual_daemon.program.recording.audit_file import AuditError, AuditFile
from ual_daemon.server.call_log import CallRecord


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "audit.jsonl"


def entries(file: Path) -> list[dict[str, Any]]:
    lines = file.read_bytes().splitlines()
    chain.verify(lines)
    return [json.loads(line) for line in lines]


def record(number: int, method: str = "Land") -> CallRecord:
    return CallRecord(number, f"/ual.v1.UalService/{method}", "ipv4:127.0.0.1:5", "local", "a test", 0, 1, True, b"", 1)


def end(daemon: DaemonProcess) -> None:
    daemon.signal(signal.SIGTERM)
    assert daemon.wait() == 0


def test_a_flight_is_in_it_in_order(start_daemon: StartDaemon, file: Path) -> None:
    daemon = start_daemon("--auto-arm", "--set", "light.speed_factor=10", "--audit", str(file))
    with ual.Uav(address=daemon.address) as uav:
        uav.wait_for(State.LANDED_ARMED, timeout_s=LIMIT_S)
        uav.take_off(3.0)
        with pytest.raises(ual.InvalidArgumentError):
            uav.take_off(-1.0)
        uav.go_to_waypoint(Pose.at(2.0, 0.0, 3.0))
        for _ in range(50):
            uav.set_velocity(Twist(Vector3(0.5, 0.0, 0.0)))
        with uav.lease("survey"):
            uav.abort()
        uav.land()
        uav.telemetry()
    end(daemon)
    found = entries(file)
    assert found[0]["event"] == "opened"
    ended = [each for each in found if each["event"] == "ended"]
    methods = [each["method"].rpartition("/")[2] for each in ended]
    without_setpoints = [method for method in methods if method not in ("SetVelocity", "StreamSetpoints")]
    assert without_setpoints == ["TakeOff", "TakeOff", "GoToWaypoint", "AcquireLease", "Abort", "ReleaseLease", "Land"]
    take_off, refused, go_to, *_ = (each for each in ended if each["method"].rpartition("/")[2] in without_setpoints)
    assert (take_off["state_before"], take_off["state_after"]) == ("LANDED_ARMED", "FLYING_AUTO")
    assert (take_off["identity"], take_off["ns"], take_off["status"]) == ("local", "uav_1", "OK")
    assert take_off["request"] == {"height_m": 3.0}
    [acquired] = [each for each in ended if each["method"].endswith("AcquireLease")]
    assert (acquired["response"]["lease_id"], acquired["response"]["lease"]["holder"]) == ("(secret)", "survey")
    assert (refused["status"], refused["reason"]) == ("INVALID_ARGUMENT", "INVALID_ARGUMENT")
    assert go_to["response"]["task"]["status"] == "TASK_STATUS_SUCCEEDED"
    [stream] = [each for each in ended if each["method"].endswith("StreamSetpoints")]
    assert stream["requests_count"] >= 1
    began = [each["method"].rpartition("/")[2] for each in found if each["event"] == "began"]
    assert began[:2] == ["TakeOff", "GoToWaypoint"]  # what takes a while is in it from its beginning


def test_each_row_is_in_it_before_the_caller_could_be_queried_about_it(start_daemon: StartDaemon, file: Path) -> None:
    first = start_daemon("--auto-arm", "--audit", str(file))
    with ual.Uav(address=first.address) as uav:
        uav.add_frame(ual.Transform(Vector3(1.0, 0.0, 0.0), child_frame_id="tower"))
    end(first)
    head = first.wait_for("audit_ends")["head"]
    second = start_daemon("--auto-arm", "--audit", str(file))
    second.wait_for("listening")
    end(second)
    found = entries(file)
    assert [each["event"] for each in found] == ["opened", "ended", "opened"]
    assert found[1]["hash"] == head


def test_a_killed_daemon_leaves_a_chain_that_the_next_one_goes_on_with(start_daemon: StartDaemon, file: Path) -> None:
    first = start_daemon("--auto-arm", "--audit", str(file))
    first.wait_for("listening")
    first.signal(signal.SIGKILL)
    first.wait()
    with file.open("ab") as torn:
        torn.write(b'{"event":"ended","meth')
    second = start_daemon("--auto-arm", "--audit", str(file))
    second.wait_for("listening")
    end(second)
    with file.open("rb") as lines:
        assert chain.verify(lines).torn_count == 1


def test_two_daemons_do_not_write_one_file(file: Path) -> None:
    first = Audit(AuditFile(file))
    with pytest.raises(AuditError, match="another daemon writes"):
        Audit(AuditFile(file))
    first.close()
    Audit(AuditFile(file)).close()


def test_a_file_that_is_no_audit_is_left_alone(file: Path) -> None:
    file.write_text("a letter\nto somebody\n")
    with pytest.raises(AuditError, match="is no audit"):
        Audit(AuditFile(file))
    assert file.read_text() == "a letter\nto somebody\n"


def test_a_full_disk_is_reported_and_what_waits_is_written_later(
    file: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(audit_writer, "_RETRY_S", 0.01)
    monkeypatch.setattr(audit_writer, "_MOST_WAITING_LINES", 3)
    written, is_full = os.write, True

    def write(to: int, data: bytes) -> int:
        if not is_full:
            return written(to, data)
        if len(data) > 20:
            return written(to, data[:20])  # a part of a line still fits
        raise OSError(errno.ENOSPC, "No space left on device")

    with stepped() as uav:
        it = Audit(AuditFile(file))
        monkeypatch.setattr("ual_daemon.program.recording.audit_file.os.write", write)
        for number in range(20):
            it.put_call(uav.vehicle, record(number), None)
        while "audit_fails" not in [vars(each).get("ual_event") for each in caplog.records]:
            it.put_call(uav.vehicle, record(99), None)
        is_full = False
        while "audit_lost" not in [vars(each).get("ual_event") for each in caplog.records]:
            it.put_call(uav.vehicle, record(100), None)
        it.close()
    found = entries(file)
    assert found[0]["event"] == "opened"
    assert any(each["event"] == "lost" and each["lines"] > 0 for each in found)
    assert [vars(each).get("ual_event") for each in caplog.records].count("audit_fails") == 1


@pytest.mark.parametrize(
    ("method", "is_one"),
    [
        ("/ual.v1.UalService/Land", True),
        ("/ual.v1.UalService/SetHome", True),
        ("/ual.v1.UalService/AcquireLease", True),
        ("/ual.v1.SimulationService/PilotArm", True),
        ("/ual.v1.ParameterService/SetParameter", True),
        ("/ual.v1.ParameterService/ListParameters", False),
        ("/ual.v1.FenceService/UploadFence", True),
        ("/ual.v1.FenceService/GetFence", False),
        ("/ual.v1.GripperService/Release", True),
        ("/ual.v1.GripperService/GetEquipment", False),
        ("/ual.v1.UalService/KeepLease", False),
        ("/ual.v1.UalService/StreamTelemetry", False),
        ("/grpc.health.v1.Health/Check", False),
    ],
)
def test_what_changes_something_is_in_it(method: str, is_one: bool) -> None:
    assert changes(method) is is_one
