"""Corrections for the receiver of the UAV: what is passed on, and for which callers. See docs/how-to/corrections.md."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

from typing_extensions import override

from ual import interface
from ual.corrections import MOST_BYTES, CorrectionsStatus, cut
from ual.errors import ResourceExhaustedError
from ual_daemon import validation
from ual_daemon.backends.offers.corrections import AutopilotCorrections
from ual_daemon.services.rtcm import RtcmFramer
from ual_daemon.services.vehicle import ServedVehicle, driver_of, require_not_watching

MOST_BYTES_PER_S = 20_000
"""A base station sends 1 to 4 kB a second. More would take time from flights."""
BURST_BYTES = 65_536
"""Most bytes at once: those that a caster or a base has kept while a connection was away."""
LONGEST_NAME_CHARACTERS = 100


class CorrectionsStream:
    """Corrections of one program, from its first bytes to `close`. For one thread at a time."""

    def __init__(self, offer: AutopilotCorrections, sender: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._offer = offer
        self._sender = sender
        self._framer = RtcmFramer()
        self._clock = clock
        self._allowed_bytes, self._allowed_s = float(BURST_BYTES), clock()
        offer.turn.keep(self, sender)

    def send(self, rtcm: bytes) -> None:
        """Passes on the whole messages that these bytes complete.

        Raises:
            InvalidArgumentError: They are no bytes, or too many at once.
            ResourceExhaustedError: Too many have come, or another program sends by now.

        """
        validation.require_type(rtcm, bytes, "rtcm")
        if len(rtcm) > MOST_BYTES:
            raise validation.refuse("rtcm", f"{len(rtcm)} bytes, of which one element has at most {MOST_BYTES}")
        self._require_rate(len(rtcm))
        self._offer.turn.keep(self, self._sender)
        skipped_count = self._framer.skipped_count
        for message in self._framer.feed(rtcm):
            self._offer.inject(message)
        self._offer.turn.skipped_bytes_count += self._framer.skipped_count - skipped_count

    def close(self) -> None:
        """Lets others send."""
        self._offer.turn.leave(self)

    def _require_rate(self, bytes_count: int) -> None:
        now_s = self._clock()
        earned = (now_s - self._allowed_s) * MOST_BYTES_PER_S
        self._allowed_bytes, self._allowed_s = min(BURST_BYTES, self._allowed_bytes + earned), now_s
        if bytes_count > self._allowed_bytes:
            text = f"corrections: more than {MOST_BYTES_PER_S} bytes a second came from {self._sender}"
            raise ResourceExhaustedError(text, {"limit": str(MOST_BYTES_PER_S)})
        self._allowed_bytes -= bytes_count


class VehicleCorrections:
    """The corrections of one UAV. From any thread; no method waits."""

    def __init__(self, vehicle: ServedVehicle) -> None:
        self._vehicle = vehicle

    def open(self, sender: str) -> CorrectionsStream:
        """Begins to send; see `ual.interface.Corrections.stream`. `sender` is human-readable."""
        offer = self._offer()
        require_not_watching(self._vehicle, "stream corrections")
        return CorrectionsStream(offer, sender[:LONGEST_NAME_CHARACTERS])

    def status(self) -> CorrectionsStatus:
        """See `ual.interface.Corrections`."""
        offer = self._offer()
        found = offer.injected()
        return CorrectionsStatus(
            offer.turn.name,
            found.messages_count,
            found.bytes_count,
            found.dropped_count,
            found.too_long_count,
            offer.turn.skipped_bytes_count,
            None if found.left_s is None else max(0.0, offer.now_s() - found.left_s),
        )

    def _offer(self) -> AutopilotCorrections:
        return driver_of(self._vehicle, AutopilotCorrections, "corrections")  # type: ignore[type-abstract]  # it is only looked for


class CorrectionsBase(interface.Corrections):
    """Members that are more than a call: the stream."""

    _of_vehicle: VehicleCorrections

    @override
    def stream(self, rtcm: Iterable[bytes], sender: str = "") -> CorrectionsStatus:
        validation.require_type(sender, str, "sender")
        stream = self._of_vehicle.open(sender or "this program")
        try:
            for each in cut(rtcm):
                stream.send(each)
        finally:
            stream.close()
        return self._of_vehicle.status()
