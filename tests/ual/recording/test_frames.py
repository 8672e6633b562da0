"""Recorded frames, and the times of their records."""

from __future__ import annotations

from pathlib import Path

from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

from tests.waiting import until
from ual.errors import LinkLostError
from ual.geometry import Transform, Vector3
from ual.recording.frames import FrameChanges, FrameRecording
from ual.recording.reader import Recording
from ual.recording.recorder import Recorder
from ual.recording.telemetry import TelemetryTopics
from ual.types import Frame

S = 1_000_000_000


def frames(x: float) -> list[Frame]:
    return [
        Frame("uav_1/base_link", "uav_1/odom", Transform(Vector3(x)), is_static=False),
        Frame("car", "map", Transform(Vector3(x), frame_id="map", child_frame_id="car"), is_static=False),
    ]


def test_frames_are_due_when_they_have_moved_and_now_and_then() -> None:
    changes = FrameChanges("uav_1")
    first = changes.due(frames(1.0), 10 * S)
    assert [each.frame_id for each in first] == ["car"]
    assert not changes.due([*frames(5.0)[:1], *frames(1.0)[1:]], 10 * S + 1)  # the body is in each sample
    assert changes.due(frames(2.0), 10 * S + 2)
    assert not changes.due(frames(2.0), 11 * S)
    assert changes.due(frames(2.0), 11 * S + 2)
    changes.forget()
    assert changes.due(frames(2.0), 11 * S + 3)


def test_a_client_records_where_a_frame_moves(tmp_path: Path) -> None:
    recorder, place = Recorder(tmp_path, "uav_1"), [1.0]

    def requests_made() -> list[Frame]:
        if place[0] == 2.0:
            place[0] = 3.0
            raise LinkLostError("the daemon does not answer")
        return frames(place[0])

    def drawn() -> list[float]:
        found = Recording(recorder.path).messages(lambda topic: topic == "/uav_1/tf")
        return [each.translation.x for one in found for each in FrameTransforms.FromString(one.data).transforms]

    recorder.start()
    recording = FrameRecording("uav_1", requests_made, TelemetryTopics("uav_1"), recorder)
    until(lambda: 1.0 in drawn(), "it is drawn")
    place[0] = 2.0
    until(lambda: 3.0 in drawn(), "it is drawn where it is now")
    recording.close()
    recorder.close()
