"""The camera that the autopilot itself triggers, by a servo, a relay or a pin. It says that it did, and no more."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future

from typing_extensions import override

from ual.errors import UalError, UalTimeoutError
from ual.types import GeoPoint
from ual_daemon.backends.engine.photo_log import PhotoLog
from ual_daemon.backends.mavlink.protocols import camera_values
from ual_daemon.backends.mavlink.protocols.exchange import Exchange
from ual_daemon.backends.mavlink.protocols.protocol import Handler
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.offers.cameras import TakenPhoto, Viewpoint

REPORT_S = 8.0
"""A report of a picture is waited for so long, with the acknowledgement of its order."""


class _Triggering(Exchange[TakenPhoto]):
    """Waits for the report of a picture that is ordered."""

    def __init__(self, future: Future[TakenPhoto]) -> None:
        super().__init__(future)
        self._until_s: float | None = None

    @override
    def tick(self, now_s: float) -> None:
        if self._until_s is None:
            self._until_s = now_s + REPORT_S
        elif now_s >= self._until_s:
            self.fail(
                UalTimeoutError(
                    f"the autopilot has not told a picture for {REPORT_S:g} s: it is not known whether it took one"
                )
            )

    def on_photo(self, taken: TakenPhoto) -> None:
        """Ends with a picture."""
        self._end(taken)


class CameraTrigger:
    """Belongs to the thread that receives; `photos`, `missed_count` and `distance_m` are for any thread.

    ArduPilot reports each picture by a CAMERA_FEEDBACK, PX4 by a CAMERA_TRIGGER. Only the kind that came first counts,
    so that no picture counts twice. `look` returns from where a picture is taken now, `utc_s` the present time.
    """

    def __init__(self) -> None:
        self.look: Callable[[], Viewpoint] = Viewpoint
        self.utc_s: Callable[[], float] = time.time
        self.photos: PhotoLog[TakenPhoto] = PhotoLog()
        self.missed_count = 0
        """Reports that were lost: by their numbers."""
        self.distance_m: float | None = None
        """What was ordered last."""
        self._kind: int | None = None
        self._last: int | None = None
        self._waiting: list[_Triggering] = []

    @property
    def handlers(self) -> dict[int, Handler]:
        """What takes the messages of an id."""
        return {
            mavlink.MAVLINK_MSG_ID_CAMERA_FEEDBACK: lambda message, _: self._on_feedback(message),
            mavlink.MAVLINK_MSG_ID_CAMERA_TRIGGER: lambda message, _: self._on_report(message, message.seq, None),
        }

    def await_photo(self, future: Future[TakenPhoto]) -> None:
        """Ends a future with the next picture."""
        self._waiting.append(_Triggering(future))

    def tick(self, now_s: float) -> None:
        """Ends what has waited too long; to be called often."""
        for each in self._waiting:
            each.tick(now_s)
        self._waiting = [each for each in self._waiting if not each.is_over]

    def drop(self, error: UalError) -> None:
        """Ends what waits. The numbers of pictures may begin again."""
        for each in self._waiting:
            each.fail(error)
        self._waiting, self._last, self.distance_m = [], None, None

    def _on_feedback(self, message: Message) -> None:
        place = None
        if message.lat or message.lng:
            place = GeoPoint(message.lat / 1e7, message.lng / 1e7, message.alt_msl, message.alt_rel)
        self._on_report(message, message.img_idx, place)

    def _on_report(self, message: Message, number: int, place: GeoPoint | None) -> None:
        kind = message.get_msgId()
        if self._kind not in (None, kind) or number == self._last:
            return
        if self._last is not None and 0 < number - self._last <= camera_values.LARGEST_GAP:
            self.missed_count += number - self._last - 1
        self._kind, self._last = kind, number
        here = self.look()
        stamp_s = camera_values.stamp_us(message.time_usec) or self.utc_s()
        viewpoint = here._replace(position_geo=place or here.position_geo)
        taken = self.photos.add(lambda added: TakenPhoto(added, stamp_s, viewpoint))
        for each in self._waiting:
            each.on_photo(taken)
