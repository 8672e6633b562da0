"""Payload of a UAV in a recording: the content of the file, and the questions and their frequency."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

from tests.conftest import LIMIT_S
from tests.waiting import until
from ual.errors import LinkLostError, NotSupportedError, UalError
from ual.geometry import Quaternion, Transform, Vector3
from ual.gimbals import GimbalInfo, GimbalStatus
from ual.gripper import Equipment, GripperInfo, GripperState
from ual.recording import carried
from ual.recording.carried import PayloadRecorder
from ual.recording.reader import Recording
from ual.recording.recorder import Recorder, Turnover
from ual.types import Frame
from ual.v1 import gripper_pb2 as pb
from ual.wire import gripper as convert

PLACE = Vector3(0.1, 0.0, -0.05)
DOWN = Quaternion.from_euler(0.0, math.pi / 2.0, 0.0)
NOT_OFFERED = NotSupportedError("this backend does not offer them")


class Gimbals:
    """One gimbal, which tells the statuses that the test gives, and then loses its link."""

    def __init__(self, *statuses: GimbalStatus) -> None:
        self.statuses = list(statuses)
        self.error: UalError | None = None
        self.asked_count = 0

    def get_all(self) -> list[GimbalInfo]:
        self.asked_count += 1
        if self.error is not None:
            raise self.error
        return [GimbalInfo(0, "made up", frozenset(), frame_id="uav_1/gimbal_0")]

    def __getitem__(self, number: int) -> Gimbals:
        assert number == 0
        return self

    def watch(self, rate_hz: float) -> Iterator[GimbalStatus]:
        assert rate_hz == 5.0
        while self.statuses:
            yield self.statuses.pop(0)
        raise LinkLostError("it is not heard")


class Gripper:
    """Payload devices: the answers that the test gives, the last one again and again."""

    def __init__(self, *answers: Equipment | UalError) -> None:
        self.answers = list(answers)
        self.asked_count = 0

    def get_all(self) -> Equipment:
        self.asked_count += 1
        answer = self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]
        if isinstance(answer, UalError):
            raise answer
        return answer


def frames() -> list[Frame]:
    place = Transform(PLACE, DOWN, "uav_1/base_link", "uav_1/gimbal_0")
    return [Frame("map", "", None, is_static=True), Frame("uav_1/gimbal_0", "uav_1/base_link", place, is_static=False)]


def holding(state: GripperState) -> Equipment:
    return Equipment((GripperInfo("claw", state),))


@pytest.fixture(autouse=True)
def _often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(carried, "_EQUIPMENT_CHECK_S", 0.001)
    monkeypatch.setattr(carried, "_EQUIPMENT_S", 0.001)


@pytest.fixture
def recorder(tmp_path: Path) -> Iterator[Recorder]:
    made = Recorder(tmp_path, "uav_1")
    made.start()
    yield made
    made.close()


def record(recorder: Recorder, gimbals: Gimbals, gripper: Gripper, is_done: Callable[[], bool]) -> PayloadRecorder:
    of_gimbals: Any = gimbals
    of_gripper: Any = gripper
    recorded = PayloadRecorder("uav_1", of_gimbals, of_gripper, frames, recorder)
    recorded.start()
    until(is_done, "all was asked")
    recorded.close()
    recorder.close()
    return recorded


def messages(recorder: Recorder, name: str, kind: Any) -> list[Any]:
    found = Recording(recorder.path).messages(lambda topic: topic == f"/uav_1/{name}")
    return [kind.FromString(each.data) for each in found]


def without_gimbals() -> Gimbals:
    gimbals = Gimbals()
    gimbals.error = NOT_OFFERED
    return gimbals


def test_where_a_gimbal_points_is_the_transform_of_its_frame(recorder: Recorder) -> None:
    gimbals = Gimbals(GimbalStatus(100.25, in_body=Quaternion()), GimbalStatus(), GimbalStatus(100.5, in_body=DOWN))
    record(recorder, gimbals, Gripper(NOT_OFFERED), lambda: not gimbals.statuses)
    first, second = (each.transforms[0] for each in messages(recorder, "gimbal_0/tf", FrameTransforms))
    assert (second.parent_frame_id, second.child_frame_id) == ("uav_1/base_link", "uav_1/gimbal_0")
    assert (second.translation.x, second.translation.y, second.translation.z) == tuple(PLACE)
    turned = Quaternion(second.rotation.x, second.rotation.y, second.rotation.z, second.rotation.w)
    assert (turned.rotate(Vector3(1.0)) - Vector3(0.0, 0.0, -1.0)).norm() < 1e-9  # it looks down its x
    assert (first.rotation.w, first.timestamp.nanos) == (1.0, 250_000_000)
    assert (second.timestamp.seconds, second.timestamp.nanos) == (100, 500_000_000)


def test_a_gimbal_that_is_silent_is_watched_again_once_it_answers(recorder: Recorder) -> None:
    gimbals = Gimbals()
    of_gimbals: Any = gimbals
    of_gripper: Any = Gripper(NOT_OFFERED)
    recorded = PayloadRecorder("uav_1", of_gimbals, of_gripper, frames, recorder)
    recorded.start()
    until(lambda: gimbals.asked_count > 2, "it was watched in vain")
    gimbals.statuses.append(GimbalStatus(100.0, in_body=DOWN))
    until(lambda: not gimbals.statuses, "it is watched")
    recorded.close()
    recorder.close()
    assert len(messages(recorder, "gimbal_0/tf", FrameTransforms)) == 1


def test_states_are_recorded_when_they_change(recorder: Recorder) -> None:
    answers = [holding(GripperState.OPEN)] * 3 + [holding(GripperState.CLOSED)]
    gripper = Gripper(*answers[:2], LinkLostError("nothing is heard"), *answers[2:])
    record(recorder, without_gimbals(), gripper, lambda: gripper.asked_count > 6)
    found = [convert.equipment_from_proto(each) for each in messages(recorder, "equipment", pb.GetEquipmentResponse)]
    assert found == [holding(GripperState.OPEN), holding(GripperState.CLOSED)]


def test_each_file_has_the_states(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, "uav_1", Turnover(age_s=0.0))
    recorder.start()
    of_gimbals: Any = without_gimbals()
    of_gripper: Any = Gripper(holding(GripperState.OPEN))
    recorded = PayloadRecorder("uav_1", of_gimbals, of_gripper, frames, recorder)
    recorded.start()
    until(lambda: sum(map(has_states, tmp_path.glob("*.mcap"))) > 1, "two files have them")
    recorded.close()
    recorder.close()


def has_states(path: Path) -> bool:
    # One that has just been made is empty for a moment.
    return path.stat().st_size > 0 and any(each.topic == "/uav_1/equipment" for each in read(path))


def read(path: Path) -> list[Any]:
    return list(Recording(path).messages())


def test_a_uav_that_can_carry_nothing_is_queried_once_and_has_no_topic(recorder: Recorder) -> None:
    gimbals, gripper = without_gimbals(), Gripper(NOT_OFFERED)
    of_gimbals: Any = gimbals
    of_gripper: Any = gripper
    recorded = PayloadRecorder("uav_1", of_gimbals, of_gripper, frames, recorder)
    recorded.start()
    until(lambda: not any(each.is_alive() for each in recorded._threads), "its threads end by themselves")
    assert (gimbals.asked_count, gripper.asked_count) == (1, 1)
    recorder.close()
    assert {each.topic for each in read(recorder.path)} <= {"/log"}


def test_a_uav_that_carries_nothing_has_no_topic(recorder: Recorder) -> None:
    gripper = Gripper(Equipment())
    record(recorder, without_gimbals(), gripper, lambda: gripper.asked_count > 2)
    assert {each.topic for each in read(recorder.path)} <= {"/log"}


def test_what_a_daemon_that_was_started_anew_carries_is_recorded(recorder: Recorder) -> None:
    carrying = holding(GripperState.OPEN)
    gripper = Gripper(Equipment(), LinkLostError("it is not there"), carrying, carrying, Equipment())
    record(recorder, without_gimbals(), gripper, lambda: gripper.asked_count > 6)
    found = [convert.equipment_from_proto(each) for each in messages(recorder, "equipment", pb.GetEquipmentResponse)]
    assert found == [carrying, Equipment()]


def test_a_gimbal_that_is_found_as_the_recording_closes_is_not_watched(recorder: Recorder) -> None:
    asked, is_closed = threading.Event(), threading.Event()

    class Late(Gimbals):
        def get_all(self) -> list[GimbalInfo]:
            asked.set()
            is_closed.wait(LIMIT_S)
            return super().get_all()

    gimbals = Late(GimbalStatus(100.0, in_body=DOWN))
    of_gimbals: Any = gimbals
    of_gripper: Any = Gripper(NOT_OFFERED)
    recorded = PayloadRecorder("uav_1", of_gimbals, of_gripper, frames, recorder)
    recorded.start()
    assert asked.wait(LIMIT_S)
    recorded.close(0.0)
    is_closed.set()
    until(lambda: not any(each.is_alive() for each in recorded._threads), "its threads end by themselves")
    assert len(recorded._threads) == 2, "another one was begun"
    assert gimbals.statuses
