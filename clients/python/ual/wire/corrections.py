"""Between the messages of `CorrectionsService` and the value types."""

from __future__ import annotations

from ual.corrections import CorrectionsStatus
from ual.v1 import corrections_pb2 as pb


def to_proto(status: CorrectionsStatus) -> pb.CorrectionsStatus:
    """Makes a message."""
    return pb.CorrectionsStatus(
        sender=status.sender,
        messages_count=status.messages_count,
        bytes_count=status.bytes_count,
        dropped_count=status.dropped_count,
        too_long_count=status.too_long_count,
        skipped_bytes_count=status.skipped_bytes_count,
        age_s=status.age_s,
    )


def of_response(response: pb.StreamCorrectionsResponse | pb.GetCorrectionsStatusResponse) -> CorrectionsStatus:
    """Reads the status of a response."""
    message = response.status
    return CorrectionsStatus(
        message.sender,
        message.messages_count,
        message.bytes_count,
        message.dropped_count,
        message.too_long_count,
        message.skipped_bytes_count,
        message.age_s if message.HasField("age_s") else None,
    )
