"""Between the messages of ``corrections.proto`` and their values. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from ual.contract.corrections import CorrectionsStatus
from ual.v1 import corrections_pb2 as pb


def corrections_status_to_proto(value: CorrectionsStatus) -> pb.CorrectionsStatus:
    """Makes a message."""
    return pb.CorrectionsStatus(
        sender=value.sender,
        messages_count=value.messages_count,
        bytes_count=value.bytes_count,
        dropped_count=value.dropped_count,
        too_long_count=value.too_long_count,
        skipped_bytes_count=value.skipped_bytes_count,
        age_s=value.age_s,
    )


def corrections_status_from_proto(message: pb.CorrectionsStatus) -> CorrectionsStatus:
    """Reads a message."""
    return CorrectionsStatus(
        message.sender,
        message.messages_count,
        message.bytes_count,
        message.dropped_count,
        message.too_long_count,
        message.skipped_bytes_count,
        message.age_s if message.HasField("age_s") else None,
    )
