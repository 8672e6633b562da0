"""Reports of the autopilot about the camera that it triggers itself, by a servo, a relay or a pin."""

from __future__ import annotations

from collections import deque

from ual.types import GeoPoint
from ual_daemon.backends.firmwares.triggered_photos import TriggeredPhotos
from ual_daemon.backends.mavlink.protocols import camera_values
from ual_daemon.backends.mavlink.protocols.protocol import Handler
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink

MOST_KNOWN_REPORTS = 16
"""Most reports by which one that comes twice is known. Both come within a jitter of the link."""


class AutopilotCameraTrigger(TriggeredPhotos):
    """ArduPilot reports each picture by a CAMERA_FEEDBACK, PX4 by a CAMERA_TRIGGER. Only the kind that came first
    counts, so that no picture counts twice.
    """

    def __init__(self) -> None:
        super().__init__()
        self._kind: int | None = None
        self._known: deque[tuple[int, int]] = deque(maxlen=MOST_KNOWN_REPORTS)
        """Numbers and times of the last reports."""

    @property
    def handlers(self) -> dict[int, Handler]:
        """Handlers of messages, by id."""
        return {
            mavlink.MAVLINK_MSG_ID_CAMERA_FEEDBACK: lambda message, _: self._on_feedback(message),
            mavlink.MAVLINK_MSG_ID_CAMERA_TRIGGER: lambda message, _: self._on_kind(message, message.seq, None),
        }

    def _on_feedback(self, message: Message) -> None:
        position = None
        if message.lat or message.lng:
            position = GeoPoint(message.lat / 1e7, message.lng / 1e7, message.alt_msl, message.alt_rel)
        self._on_kind(message, message.img_idx, position)

    def _on_kind(self, message: Message, number: int, position: GeoPoint | None) -> None:
        kind, report = message.get_msgId(), (number, message.time_usec)
        if self._kind in (None, kind) and not (message.time_usec and report in self._known):
            self._kind = kind
            self._known.append(report)
            self.on_report(number, camera_values.stamp_us(message.time_usec), position)
