"""Recording of a daemon: every call, setpoint, state and sample, and its rest when the daemon is killed."""

from __future__ import annotations

import itertools
import json
import math
import signal
import threading
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import grpc
import pytest
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

import ual
from tests.conftest import DaemonProcess, StartDaemon
from tests.patient_checks import run_check
from tests.waiting import until
from ual import conformance
from ual.access import audit as chain
from ual.conformance import Flight, Tolerances
from ual.errors import UalError
from ual.geometry import Twist, Vector3
from ual.gripper import GripperState
from ual.recording.reader import Message, Recording
from ual.types import State
from ual.v1 import gripper_pb2 as pb
from ual.wire import gripper as convert
from ual_daemon.program.recording.audit import changes

SERVICE = "/ual.v1.UalService/"
SPEED = "light.speed_factor=10"


def recording_in(directory: Path) -> Recording:
    [path] = directory.glob("*.mcap")
    return Recording(path)


def messages(recording: Recording, name: str) -> list[Message]:
    return list(recording.messages(lambda topic: topic.removeprefix("/uav_1") == f"/{name}"))


def calls(recording: Recording, event: str = "ended") -> list[dict[str, Any]]:
    return [call for message in messages(recording, "calls") if (call := message.json())["event"] == event]


def end(daemon: DaemonProcess) -> None:
    daemon.signal(signal.SIGTERM)
    assert daemon.wait() == 0, daemon.stderr


class Counted(
    grpc.UnaryUnaryClientInterceptor,
    grpc.UnaryStreamClientInterceptor,
    grpc.StreamUnaryClientInterceptor,
):
    """Counts the calls of a client, by their methods."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self._lock = threading.Lock()

    def _count(self, go_on: Callable[..., Any], details: grpc.ClientCallDetails, request: object) -> Any:
        with self._lock:
            method = details.method
            self.counts[method if isinstance(method, str) else method.decode()] += 1
        return go_on(details, request)

    intercept_unary_unary = intercept_unary_stream = intercept_stream_unary = _count  # type: ignore[assignment]


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> Counted:
    """Counts the calls of all clients that are made from now on."""
    counted, make = Counted(), grpc.insecure_channel
    monkeypatch.setattr(grpc, "insecure_channel", lambda *a, **k: grpc.intercept_channel(make(*a, **k), counted))
    return counted


def assert_audited(audit: Path, counts: Counter[str]) -> None:
    """Every call that changes something is in the audit once, in the order in which they came."""
    lines = audit.read_bytes().splitlines()
    chain.verify(lines)
    found = [entry for entry in map(json.loads, lines) if "method" in entry]
    assert Counter(each["method"] for each in found if each["event"] == "ended") == Counter(
        {method: count for method, count in counts.items() if changes(method)}
    )
    first = {each["id"]: number for number, each in reversed(list(enumerate(found)))}
    assert sorted(first, key=lambda number: first[number]) == sorted(first)


@pytest.mark.parametrize("transport", ["core", "aio"])
def test_every_call_of_a_flight_is_recorded(
    start_daemon: StartDaemon, counted: Counted, tmp_path: Path, transport: str
) -> None:
    directory = tmp_path / "recorded"
    audit = tmp_path / "audit.jsonl"
    flags = ("--record", str(directory), "--audit", str(audit))
    daemon = start_daemon("--set", SPEED, "--transport", transport, *flags)
    names = "says_who_it_is telemetry_flows bad_frames_are_refused takes_off flies_by_velocity lands"
    checks = [each for each in conformance.CHECKS if each.name in names.split()]
    with ual.Uav("uav_1", address=daemon.address) as uav:
        flight = Flight(uav, Tolerances.of_simulation())
        for check in checks:
            run_check(flight, check)
        with pytest.raises(UalError, match=r"LANDED"):
            uav.land()
    end(daemon)
    recording = recording_in(directory)
    ended = calls(recording)
    assert Counter(call["method"] for call in ended) == counted.counts
    assert {call["caller"].split(":")[0] for call in ended} == {"ipv4"}
    assert_audited(audit, counted.counts)
    assert {call["id"] for call in calls(recording, "began")} <= {call["id"] for call in ended}
    [take_off] = [call for call in ended if call["method"] == f"{SERVICE}TakeOff" and call["status"] == "OK"]
    assert take_off["request"]["height_m"] > 0.0
    assert take_off["response"]["task"]["status"] == "TASK_STATUS_SUCCEEDED"
    assert take_off["duration_s"] > 0.0
    refused = [call for call in ended if call["method"] == f"{SERVICE}Land"][-1]
    assert (refused["status"], refused["reason"]) == ("FAILED_PRECONDITION", "WRONG_STATE")
    assert refused["metadata"]["state"].startswith("LANDED")


def test_a_flight_is_recorded_as_it_was(start_daemon: StartDaemon, tmp_path: Path) -> None:
    directory = tmp_path / "recorded"
    daemon = start_daemon("--auto-arm", "--set", SPEED, "--record", str(directory))
    with ual.Uav("uav_1", address=daemon.address) as uav:
        uav.wait_for(State.LANDED_ARMED)
        uav.take_off(2.0)
        uav.set_velocity(Twist(Vector3(0.5, 0.0, 0.0)))
        uav.abort()
        uav.land()
        uav.wait_for(State.LANDED_DISARMED)
    end(daemon)
    recording = recording_in(directory)
    samples = [message.telemetry() for message in messages(recording, "telemetry")]
    assert {b.sequence - a.sequence for a, b in itertools.pairwise(samples)} == {1}
    changes = [message.json() for message in messages(recording, "states")]
    logged = [event for event in daemon.events if event.get("event") == "state"]
    assert [(each["new"], each["why"]) for each in changes] == [(each["new"], each["why"]) for each in logged]
    kinds = {message.json()["kind"] for message in messages(recording, "setpoints")}
    assert kinds == {"position", "velocity"}
    topics = Counter(message.schema for message in recording.messages())
    assert topics["foxglove.PoseInFrame"] >= len(samples)
    assert {"foxglove.FrameTransforms", "foxglove.LocationFix", "foxglove.Log", "ual.v1.GetInfoResponse"} <= set(topics)
    assert recording.is_whole


def test_a_killed_daemon_leaves_a_file_that_can_be_read(start_daemon: StartDaemon, tmp_path: Path) -> None:
    directory = tmp_path / "recorded"
    daemon = start_daemon("--auto-arm", "--set", SPEED, "--record", str(directory))
    with ual.Uav("uav_1", address=daemon.address) as uav:
        uav.wait_for(State.LANDED_ARMED)
        uav.take_off(3.0)
    until(lambda: last_state(directory) == "FLYING_AUTO")  # it can be read while it is written
    daemon.signal(signal.SIGKILL)
    daemon.wait()
    recording = recording_in(directory)
    assert messages(recording, "telemetry")[-1].telemetry().state is State.FLYING_AUTO
    assert not recording.is_whole
    assert last_state(directory) == "FLYING_AUTO"


def last_state(directory: Path) -> str:
    changes = messages(recording_in(directory), "states")
    return str(changes[-1].json()["new"]) if changes else ""


def test_a_directory_that_cannot_be_written_is_refused_before_anything_flies(
    start_daemon: StartDaemon, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("no directory")
    daemon = start_daemon("--record", str(tmp_path / "file"))
    assert daemon.wait() == 1
    assert daemon.stderr.strip() == f"ual-daemon: cannot record into {tmp_path / 'file'}: File exists"


def test_pictures_are_recorded_where_that_is_requested(start_daemon: StartDaemon, tmp_path: Path) -> None:
    daemon = start_daemon("--record", str(tmp_path), "--record-pictures", backend="light")
    daemon.wait_for("state", new="LANDED_DISARMED")
    with ual.Uav(daemon.ns) as uav:
        taken = uav.cameras[0].take_photo()
        wanted = uav.cameras[0].image(taken.number).data
    recording = recording_in(tmp_path)
    until(lambda: any(wanted in each.data for each in messages(recording, "camera_0/image")), "it is in the file")
    end(daemon)
    assert [len(messages(recording, f"camera_0/{name}")) for name in ("photos", "tf", "calibration")] == [1, 1, 1]


def test_a_moving_frame_is_recorded_as_it_moves(start_daemon: StartDaemon, tmp_path: Path) -> None:
    daemon = start_daemon("--record", str(tmp_path), backend="light")
    daemon.wait_for("state", new="LANDED_DISARMED")
    recording = recording_in(tmp_path)

    def drawn() -> list[float]:
        found = [FrameTransforms.FromString(each.data) for each in messages(recording, "tf")]
        return [each.translation.x for one in found for each in one.transforms if each.child_frame_id == "car"]

    with ual.Uav(daemon.ns) as uav:
        for x in (1.0, 2.0, 3.0):
            uav.add_frame(ual.Transform(ual.Vector3(x), child_frame_id="car"))
            until(lambda x=x: x in drawn(), "it is drawn there")  # type: ignore[misc]
        uav.remove_frame("car")
        until(lambda: "car" not in {each.frame_id for each in messages(recording, "frames")[-1].frames()}, "it is gone")


def test_what_is_carried_is_recorded(start_daemon: StartDaemon, tmp_path: Path) -> None:
    devices = ("--set", 'payload.grippers=[{"name": "claw"}]', "--set", 'light.gimbals=[{"position": [0.1, 0, 0]}]')
    daemon = start_daemon("--record", str(tmp_path), *devices, backend="light")
    daemon.wait_for("state", new="LANDED_DISARMED")
    recording = recording_in(tmp_path)

    def states() -> list[GripperState]:
        found = [pb.GetEquipmentResponse.FromString(each.data) for each in messages(recording, "equipment")]
        return [convert.equipment_from_proto(each).grippers[0].state for each in found]

    def views() -> list[FrameTransform]:
        found = [FrameTransforms.FromString(each.data) for each in messages(recording, "gimbal_0/tf")]
        return [transform for each in found for transform in each.transforms]

    until(lambda: GripperState.OPEN in states(), "it is open")
    with ual.Uav(daemon.ns) as uav:
        uav.gripper.grip()
        uav.gimbals[0].set_angles(1.0)
    until(lambda: GripperState.CLOSED in states(), "it is closed")
    until(lambda: any(each.rotation.y == pytest.approx(math.sin(0.5), abs=1e-3) for each in views()), "it looks down")
    end(daemon)
    assert {(each.parent_frame_id, each.child_frame_id) for each in views()} == {("uav_1/base_link", "uav_1/gimbal_0")}
    assert {each.translation.x for each in views()} == {0.1}


def test_a_uav_without_cameras_is_recorded_all_the_same(start_daemon: StartDaemon, tmp_path: Path) -> None:
    daemon = start_daemon(
        "--record", str(tmp_path), "--record-pictures", "--url", "radio://0/80/2M", backend="crazyflie"
    )
    assert "does not offer them" in daemon.wait_for("no_pictures")["why"]
    with ual.Uav(address=daemon.address) as uav:  # it serves, and ends by a signal only now as it should
        assert uav.info().backend == "crazyflie"
    end(daemon)
