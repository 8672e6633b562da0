"""Between a rally point and its message, which has the reference of its height as a flag."""

from __future__ import annotations

from ual.contract.rally_point import RallyPoint
from ual.types import AltitudeReference
from ual.v1 import fence_pb2 as pb


def rally_point_to_proto(value: RallyPoint) -> pb.RallyPoint:
    """Makes a message."""
    return pb.RallyPoint(
        latitude_deg=value.latitude_deg,
        longitude_deg=value.longitude_deg,
        height_m=value.height_m,
        is_amsl=value.reference is AltitudeReference.AMSL,
    )


def rally_point_from_proto(message: pb.RallyPoint) -> RallyPoint:
    """Reads a message."""
    reference = AltitudeReference.AMSL if message.is_amsl else AltitudeReference.HOME
    return RallyPoint(message.latitude_deg, message.longitude_deg, message.height_m, reference)
