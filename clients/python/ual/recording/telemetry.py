"""Telemetry in a recording: the contract's own messages, and next to them those that viewers draw by themselves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from google.protobuf.timestamp_pb2 import Timestamp

from ual.geometry import Pose, Quaternion, Vector3
from ual.recording.recorder import Entry, Output
from ual.recording.topics import Schema, json_schema, of_json, of_protobuf
from ual.types import Frame, GeoPoint, State, Telemetry
from ual.v1 import ual_pb2 as pb
from ual.wire import samples, uav

STATE_SCHEMA: Schema = json_schema(
    "UalStateChange",
    "The state has changed.",
    old={"type": "string", "description": "empty for the first one"},
    new={"type": "string"},
    why={"type": "string", "description": "Telemetry.state_reason"},
    sequence={"type": "integer", "description": "Telemetry.sequence of the first sample with the new state"},
)


class TelemetryTopics:
    """Writes the telemetry of one UAV. Belongs to the recorder's thread."""

    def __init__(self, ns: str) -> None:
        self._state: State | None = None
        self._telemetry = of_protobuf(f"/{ns}/telemetry", pb.Telemetry)
        self._states = of_json(f"/{ns}/states", STATE_SCHEMA)
        self._pose = of_protobuf(f"/{ns}/pose", PoseInFrame)
        self._reference = of_protobuf(f"/{ns}/reference", PoseInFrame)
        self._location = of_protobuf(f"/{ns}/location", LocationFix)
        self._transforms = of_protobuf(f"/{ns}/tf", FrameTransforms)
        self._frames = of_protobuf(f"/{ns}/frames", pb.ListFramesResponse)
        self._info_topic = of_protobuf(f"/{ns}/info", pb.GetInfoResponse)

    def begin_file(self) -> None:
        """Has the state written again, in a further file."""
        self._state = None

    def write_sample(self, output: Output, entry: Entry) -> None:
        """Writes a sample of the telemetry, and the state if it has changed."""
        sample: Telemetry = entry.value
        log_ns, stamp_ns = entry.log_ns, round(sample.stamp_s * 1e9) or entry.log_ns
        message = samples.telemetry_to_proto(sample)
        output.write(self._telemetry, message.SerializeToString(), log_ns, stamp_ns, sample.sequence)
        if sample.state is not self._state:
            self._write_state(output, entry)
        stamp = stamp_of(stamp_ns)
        for topic, pose in ((self._pose, sample.pose), (self._reference, sample.reference_pose)):
            if pose is not None:
                drawn = PoseInFrame(timestamp=stamp, frame_id=sample.frame_id)
                _write_pose(pose, drawn.pose.position, drawn.pose.orientation)
                output.write(topic, drawn.SerializeToString(), log_ns, stamp_ns)
        if sample.odometry is not None:
            body = sample.odometry
            transforms = [transform_of(stamp, body.frame_id, body.child_frame_id, body.pose)]
            self._write_transforms(output, transforms, log_ns, stamp_ns)
        if sample.position_geo is not None:
            fix = _location(stamp, sample.position_geo)
            output.write(self._location, fix.SerializeToString(), log_ns, stamp_ns)

    def write_frames(self, output: Output, entry: Entry) -> None:
        """Writes frames, as they are reported and as viewers draw them: those of `FrameChanges.due`."""
        frames: Sequence[Frame] = entry.value
        response = pb.ListFramesResponse(frames=[uav.frame_to_proto(frame) for frame in frames])
        output.write(self._frames, response.SerializeToString(), entry.log_ns, entry.log_ns)
        stamp = stamp_of(entry.log_ns)
        transforms = [
            transform_of(stamp, f.parent_frame_id, f.frame_id, Pose(f.transform.translation, f.transform.rotation))
            for f in frames
            if f.transform is not None and f.parent_frame_id
        ]
        if transforms:
            self._write_transforms(output, transforms, entry.log_ns, entry.log_ns)

    def write_info(self, output: Output, entry: Entry) -> None:
        """Writes the identity of the UAV, and its capabilities."""
        message = uav.info_to_proto(entry.value)
        output.write(self._info_topic, message.SerializeToString(), entry.log_ns, entry.log_ns)

    def _write_state(self, output: Output, entry: Entry) -> None:
        import json

        sample: Telemetry = entry.value
        old, self._state = self._state, sample.state
        change = {
            "old": "" if old is None else old.name,
            "new": sample.state.name,
            "why": sample.state_reason,
            "sequence": sample.sequence,
        }
        output.write(self._states, json.dumps(change).encode(), entry.log_ns, entry.log_ns)

    def _write_transforms(
        self, output: Output, transforms: Sequence[FrameTransform], log_ns: int, stamp_ns: int
    ) -> None:
        message = FrameTransforms(transforms=transforms)
        output.write(self._transforms, message.SerializeToString(), log_ns, stamp_ns)


def stamp_of(utc_ns: int) -> Timestamp:
    """Returns a time since 1970."""
    return Timestamp(seconds=utc_ns // 1_000_000_000, nanos=utc_ns % 1_000_000_000)


def transform_of(stamp: Timestamp, parent: str, child: str, pose: Pose) -> FrameTransform:
    """Returns where a frame is in its parent."""
    message = FrameTransform(timestamp=stamp, parent_frame_id=parent, child_frame_id=child)
    _write_pose(pose, message.translation, message.rotation)
    return message


def _write_pose(pose: Pose, position: Any, orientation: Any) -> None:  # noqa: ANN401  any message with x, y, z
    _write_xyz(pose.position, position)
    _write_xyz(pose.orientation, orientation)
    orientation.w = pose.orientation.w


def _write_xyz(value: Vector3 | Quaternion, message: Any) -> None:  # noqa: ANN401
    message.x, message.y, message.z = value.x, value.y, value.z


def _location(stamp: Timestamp, location: GeoPoint) -> LocationFix:
    """Returns the position on Earth; altitudes above the ellipsoid where that is known, as viewers expect."""
    altitude_m = (
        location.altitude_ellipsoid_m if location.altitude_ellipsoid_m is not None else location.altitude_amsl_m
    )
    return LocationFix(
        timestamp=stamp,
        frame_id="",
        latitude=location.latitude_deg,
        longitude=location.longitude_deg,
        altitude=altitude_m or 0.0,
    )
