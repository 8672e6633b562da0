"""Checks of the corrections for the satellite receiver. Nothing reaches it: what is sent is no message of RTCM 3."""

from __future__ import annotations

from ual.conformance.check import check
from ual.conformance.flight import CannotRunError, Flight, require
from ual.corrections import CorrectionsStatus
from ual.errors import NotSupportedError

_GARBAGE = b"$GPGGA,no message of RTCM 3*00\r\n"
_DAMAGED = b"\xd3\x00\x04\x4c\xe0\x00\x80\x00\x00\x00"
"""A message whose checksum is wrong."""


@check()
def passes_on_no_correction_that_is_damaged(flight: Flight) -> None:
    """Data that is no message of RTCM 3, or has a wrong checksum, is counted, and is not passed on to the receiver."""
    before = _status(flight)
    if before.sender:
        raise CannotRunError(f"{before.sender} sends corrections now, and is left alone")
    after = flight.uav.corrections.stream([_GARBAGE, _DAMAGED, _GARBAGE], "ual check")
    require(after.messages_count == before.messages_count, "a damaged message was passed on")
    skipped = after.skipped_bytes_count - before.skipped_bytes_count
    least = len(_GARBAGE)
    require(skipped >= least, f"{skipped} bytes were told as skipped, of {least} that were no message")
    require(not flight.uav.corrections.status().sender, "it still counts as sending after its end")


def _status(flight: Flight) -> CorrectionsStatus:
    try:
        return flight.uav.corrections.status()
    except NotSupportedError as error:
        raise CannotRunError(error.message) from None


ON_GROUND = (passes_on_no_correction_that_is_damaged,)
