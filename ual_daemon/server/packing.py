"""Packs samples of telemetry as protobuf does, but without an object for each part of the message.

Protobuf takes a tenth of the time from the vehicle to a reader for the objects that it makes (decision 40).
Most of a sample are numbers of 8 bytes in messages that have all of their fields, so that their encoding has a fixed
form. See https://protobuf.dev/programming-guides/encoding. The rest changes rarely: protobuf packs it, and it is
kept. All numbers of fields are those of the contract, by its descriptors.
"""

from __future__ import annotations

import struct
from functools import lru_cache

from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp

from ual.geometry import Quaternion, Transform, Twist, Vector3
from ual.types import GeoPoint, Odometry, Telemetry
from ual.v1 import ual_pb2 as pb
from ual.wire import convert, uav

_VARINT, _FIXED64, _DELIMITED = 0, 1, 2
_CONTINUATION_BIT = 0x80
_SMALL = [bytes((value,)) for value in range(_CONTINUATION_BIT)]


def _varint(value: int) -> bytes:
    """Returns an unsigned number: 7 bits in each byte, the lowest first; all but the last are marked."""
    if value < _CONTINUATION_BIT:
        return _SMALL[value]
    found = bytearray()
    while value >= _CONTINUATION_BIT:
        found.append(value & (_CONTINUATION_BIT - 1) | _CONTINUATION_BIT)
        value >>= 7
    found.append(value)
    return bytes(found)


def _key(kind: type[Message], name: str) -> bytes:
    """Returns what stands before the value of a field."""
    field = kind.DESCRIPTOR.fields_by_name[name]
    wire_types = {
        FieldDescriptor.TYPE_DOUBLE: _FIXED64,
        FieldDescriptor.TYPE_MESSAGE: _DELIMITED,
        FieldDescriptor.TYPE_STRING: _DELIMITED,
        FieldDescriptor.TYPE_INT32: _VARINT,
        FieldDescriptor.TYPE_INT64: _VARINT,
        FieldDescriptor.TYPE_UINT64: _VARINT,
    }
    return _varint(field.number << 3 | wire_types[field.type])


def _delimited(key: bytes, data: bytes) -> bytes:
    return key + _varint(len(data)) + data


def _before(kind: type[Message], name: str, form: struct.Struct) -> bytes:
    """Returns what stands before a message of a fixed form."""
    return _key(kind, name) + _varint(form.size)


_X, _Y, _Z, _W = (_key(pb.Quaternion, name) for name in "xyzw")  # those of a vector are the same
_VECTOR, _QUATERNION = struct.Struct("<cdcdcd"), struct.Struct("<cdcdcdcd")
_PLACE, _TWIST = struct.Struct("<2scdcdcd2scdcdcdcd"), struct.Struct("<2scdcdcd2scdcdcd")
_OF_POSE = _before(pb.Pose, "position", _VECTOR), _before(pb.Pose, "orientation", _QUATERNION)
_OF_TRANSFORM = _before(pb.Transform, "translation", _VECTOR), _before(pb.Transform, "rotation", _QUATERNION)
_LINEAR, _ANGULAR = (_before(pb.Twist, name, _VECTOR) for name in ("linear", "angular"))
_POSE, _REFERENCE_POSE = (_before(pb.Telemetry, name, _PLACE) for name in ("pose", "reference_pose"))
_VELOCITY = _before(pb.Telemetry, "velocity", _TWIST)
_ODOMETRY_POSE, _ODOMETRY_TWIST = _before(pb.Odometry, "pose", _PLACE), _before(pb.Odometry, "twist", _TWIST)
_HEADER, _ODOMETRY, _TRANSFORM, _GEO, _TASK, _SEQUENCE = (
    _key(pb.Telemetry, name) for name in ("header", "odometry", "transform", "position_geo", "task", "sequence")
)  # the header of odometry and transform, too
_STAMP, _NANOS, _64_BITS = _key(pb.Header, "stamp"), _key(Timestamp, "nanos"), (1 << 64) - 1
_PLACE_ON_EARTH, _ALTITUDE = struct.Struct("<cdcd"), struct.Struct("<cd")
_LATITUDE, _LONGITUDE = _key(pb.GeoPoint, "latitude_deg"), _key(pb.GeoPoint, "longitude_deg")
_AMSL, _HOME, _ELLIPSOID = (_key(pb.GeoPoint, f"altitude_{above}_m") for above in ("amsl", "home", "ellipsoid"))
_RESPONSE = _key(pb.StreamTelemetryResponse, "telemetry")


class TelemetryPacker:
    """Packs the samples of one vehicle. Any thread may call."""

    def __init__(self) -> None:
        self._rare: tuple[tuple[object, ...], bytes] = ((), b"")
        """Values that change rarely, as they were last, and their packed bytes. Replaced as a whole."""

    def response(self, sample: Telemetry) -> bytes:
        """Returns the ``StreamTelemetryResponse`` for a reader that missed nothing."""
        return _delimited(_RESPONSE, self.pack(sample))

    def pack(self, sample: Telemetry) -> bytes:
        """Returns the ``Telemetry``."""
        pose, velocity, reference, task = sample.pose, sample.velocity, sample.reference_pose, sample.task
        stamp = _stamp(sample.stamp_s)
        parts = [self._packed_rare(sample), _delimited(_HEADER, stamp + _texts(sample.frame_id, "")[0])]
        here = b"" if pose is None else _packed_pose(_OF_POSE, pose.position, pose.orientation)
        if here:
            parts += (_POSE, here)
        if velocity is not None:
            parts += (_VELOCITY, _twist(velocity))
        if reference is not None:
            parts += (_REFERENCE_POSE, _packed_pose(_OF_POSE, reference.position, reference.orientation))
        if (odometry := sample.odometry) is not None:
            parts.append(_odometry(odometry, here if odometry.pose is pose else b"", stamp, sample.stamp_s))
        if (transform := sample.transform) is not None:
            parts.append(_transform(transform, stamp, sample.stamp_s))
        if (point := sample.position_geo) is not None:
            parts.append(_geo(point))
        if task is not None:
            parts.append(_delimited(_TASK, uav.task_info_to_proto(task).SerializeToString()))
        parts += (_SEQUENCE, _varint(sample.sequence))
        return b"".join(parts)

    def _packed_rare(self, sample: Telemetry) -> bytes:
        rare = uav.rare_of_telemetry(sample)
        known, packed = self._rare
        if rare != known:
            message = pb.Telemetry()
            uav.write_rare_of_telemetry(sample, message)
            packed = message.SerializeToString()
            self._rare = rare, packed
        return packed


def _packed_pose(before: tuple[bytes, bytes], v: Vector3, q: Quaternion) -> bytes:
    return _PLACE.pack(before[0], _X, v.x, _Y, v.y, _Z, v.z, before[1], _X, q.x, _Y, q.y, _Z, q.z, _W, q.w)


def _twist(twist: Twist) -> bytes:
    v, w = twist.linear, twist.angular
    return _TWIST.pack(_LINEAR, _X, v.x, _Y, v.y, _Z, v.z, _ANGULAR, _X, w.x, _Y, w.y, _Z, w.z)


def _stamp(stamp_s: float) -> bytes:
    """Returns the stamp of a header; nothing where it is not known."""
    if not stamp_s:
        return b""
    seconds, nanos = convert.stamp_parts(stamp_s)
    return _delimited(_STAMP, _whole(seconds) + _NANOS + _varint(nanos))


@lru_cache(maxsize=8)
def _whole(seconds: int) -> bytes:
    """Returns the seconds of a stamp. A negative number is packed as in 64 bits."""
    return _key(Timestamp, "seconds") + _varint(seconds & _64_BITS)


@lru_cache(maxsize=64)
def _texts(frame_id: str, child_frame_id: str) -> tuple[bytes, bytes]:
    """Returns the frame of a header, and the child frame next to that header."""
    child = pb.Odometry(child_frame_id=child_frame_id)  # in a transform it is the same
    return pb.Header(frame_id=frame_id).SerializeToString(), child.SerializeToString()


def _odometry(odometry: Odometry, here: bytes, stamp: bytes, stamp_s: float) -> bytes:
    """`here` is its pose as packed before, if it is the same; `stamp` a stamp as packed before, of `stamp_s`."""
    frame, child = _texts(odometry.frame_id, odometry.child_frame_id)
    header = _delimited(_HEADER, (stamp if odometry.stamp_s == stamp_s else _stamp(odometry.stamp_s)) + frame)
    bytes_of_pose = here or _packed_pose(_OF_POSE, odometry.pose.position, odometry.pose.orientation)
    return _delimited(
        _ODOMETRY, b"".join((header, child, _ODOMETRY_POSE, bytes_of_pose, _ODOMETRY_TWIST, _twist(odometry.twist)))
    )


def _transform(transform: Transform, stamp: bytes, stamp_s: float) -> bytes:
    frame, child = _texts(transform.frame_id, transform.child_frame_id)
    header = _delimited(_HEADER, (stamp if transform.stamp_s == stamp_s else _stamp(transform.stamp_s)) + frame)
    return _delimited(
        _TRANSFORM, header + child + _packed_pose(_OF_TRANSFORM, transform.translation, transform.rotation)
    )


def _geo(point: GeoPoint) -> bytes:
    found = _PLACE_ON_EARTH.pack(_LATITUDE, point.latitude_deg, _LONGITUDE, point.longitude_deg)
    if point.altitude_amsl_m is not None:
        found += _ALTITUDE.pack(_AMSL, point.altitude_amsl_m)
    if point.altitude_home_m is not None:
        found += _ALTITUDE.pack(_HOME, point.altitude_home_m)
    if point.altitude_ellipsoid_m is not None:
        found += _ALTITUDE.pack(_ELLIPSOID, point.altitude_ellipsoid_m)
    return _delimited(_GEO, found)
