"""Corrections for the satellite receiver of the UAV (RTK): what a base station sends.

As values, from ``corrections.proto``. ``make proto`` writes this file: do not edit it.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CorrectionsStatus:
    """Corrections that were sent and dropped since the daemon began.

    Args:
        sender: What sends now, by the name that it gave; empty where nothing does.
        messages_count: Messages of RTCM 3 that have left whole.
        bytes_count: Their bytes.
        dropped_count: Messages that were dropped: the link did not carry them, or was lost.
        too_long_count: Messages that were dropped because the link to the receiver cannot carry their length.
        skipped_bytes_count: Bytes that belonged to no whole message with a right checksum.
        age_s: Since when nothing has left; None before the first message.

    """

    sender: str = ""
    messages_count: int = 0
    bytes_count: int = 0
    dropped_count: int = 0
    too_long_count: int = 0
    skipped_bytes_count: int = 0
    age_s: float | None = None
