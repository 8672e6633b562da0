"""Samples that are packed without protobuf's objects: as protobuf packs them, for every reader."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import pytest
from google.protobuf.descriptor import Descriptor
from hypothesis import given
from hypothesis import strategies as st

from tests.ual import values
from ual.geometry import Pose, Quaternion, Twist, Vector3
from ual.types import Battery, Odometry, State, Telemetry
from ual.v1 import ual_pb2 as pb
from ual.wire import samples
from ual_daemon.server.packing import TelemetryPacker

HERE = Pose(Vector3(1.0, 0.0, -0.0), Quaternion(0.0, 0.0, 0.6, 0.8))
SHARED = st.builds(
    lambda sample, odometry: replace(
        sample, odometry=replace(odometry, pose=sample.pose or HERE, stamp_s=sample.stamp_s)
    ),
    values.telemetries,
    values.odometries,
)
"""As they are in flight: the odometry has the pose and the stamp of the sample."""


def expected(sample: Telemetry) -> pb.StreamTelemetryResponse:
    return pb.StreamTelemetryResponse(telemetry=samples.telemetry_to_proto(sample))


@given(st.lists(values.telemetries | SHARED, min_size=1, max_size=3))
def test_samples_are_packed_as_protobuf_packs_them(samples: list[Telemetry]) -> None:
    packer = TelemetryPacker()
    for sample in samples:
        found = pb.StreamTelemetryResponse.FromString(packer.response(sample))
        assert found == expected(sample)
        # By the bytes, too: 0.0 equals -0.0 in a message.
        assert found.SerializeToString(deterministic=True) == expected(sample).SerializeToString(deterministic=True)


def test_what_changes_rarely_is_packed_anew_when_it_changes() -> None:
    packer = TelemetryPacker()
    sample = Telemetry(State.FLYING_AUTO, "in the air", battery=Battery(80.0))
    changed = (
        sample,
        replace(sample, battery=Battery(79.0)),
        replace(sample, state=State.LANDING),
        replace(sample, state_reason="down"),
        replace(sample, armed=True),
        sample,
    )
    for each in changed:
        assert pb.Telemetry.FromString(packer.pack(each)) == samples.telemetry_to_proto(each)


@pytest.mark.parametrize("stamp_s", [0.0, -1.25, 1e-6, 0.9999995, 1_700_000_000.123456, 4_102_444_799.999999])
def test_stamps_are_packed_as_protobuf_packs_them(stamp_s: float) -> None:
    sample = Telemetry(State.LANDED_ARMED, stamp_s=stamp_s, frame_id="uav_1/odom")
    assert pb.Telemetry.FromString(TelemetryPacker().pack(sample)) == samples.telemetry_to_proto(sample)


@given(SHARED)
def test_no_field_is_packed_twice(sample: Telemetry) -> None:
    """Not all readers join a message that comes in two parts (protobuf.js takes the last part for all of it)."""
    for path, count in Counter(fields(TelemetryPacker().pack(sample), pb.Telemetry.DESCRIPTOR)).items():
        assert count == 1, path


def fields(data: bytes, kind: Descriptor, path: str = "") -> Iterator[str]:
    """Yields the name of each field in a packed message, but not of those that may come several times."""
    while data:
        key, data = varint(data)
        field = kind.fields_by_number[key >> 3]
        content, data = value_of(key & 7, data)
        if not field.is_repeated:
            yield f"{path}.{field.name}"
            if field.message_type is not None:
                yield from fields(content, field.message_type, f"{path}.{field.name}")


def value_of(wire_type: int, data: bytes) -> tuple[bytes, bytes]:
    """Returns the value at the beginning of some bytes, and the rest."""
    match wire_type:
        case 0:
            return b"", varint(data)[1]
        case 1:
            return data[:8], data[8:]
        case _:
            size, rest = varint(data)
            return rest[:size], rest[size:]


def varint(data: bytes) -> tuple[int, bytes]:
    value = 0
    for at, byte in enumerate(data):
        value |= (byte & 0x7F) << 7 * at
        if byte < 0x80:
            return value, data[at + 1 :]
    raise AssertionError("a number that does not end")


def test_a_sample_in_flight_is_packed() -> None:
    twist = Twist(Vector3(1.0, 2.0, 3.0), Vector3(0.0, 0.0, 0.5))
    odometry = Odometry(HERE, twist, "uav_1/odom", "uav_1/base_link", 1_700_000_000.5)
    sample = Telemetry(State.FLYING_AUTO, pose=HERE, velocity=twist, odometry=odometry, sequence=300)
    found = pb.Telemetry.FromString(TelemetryPacker().pack(sample))
    assert found.odometry.pose == found.pose
    assert (found.pose.position.x, found.pose.orientation.w, found.velocity.linear.y) == (1.0, 0.8, 2.0)
    assert (found.odometry.child_frame_id, found.sequence) == ("uav_1/base_link", 300)
