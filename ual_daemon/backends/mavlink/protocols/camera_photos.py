"""The pictures that a camera reports, each once, and those whose report was lost."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable

from ual_daemon.backends.firmwares.triggered_photos import LARGEST_GAP_PHOTOS

RETRY_S = 1.0
TRIES_COUNT = 5
"""Requests for a report that is missing, ..."""
MOST_MISSING_REPORTS = 100
"""... and most missing reports at a time. What is more counts as lost at once."""
MOST_KNOWN_PHOTOS = 1000


class ReportedPhotos:
    """Takes the index and the time of each report.

    `request` requests the report of an index, and gets how often it was requested before.

    A camera numbers its pictures. A number that is left out is a report that was lost on the way, and is requested. One
    that comes again is no other picture, unless the camera has booted since: then its numbers begin again.
    """

    def __init__(self, request: Callable[[int, int], object]) -> None:
        self._request = request
        self._known: OrderedDict[int, int] = OrderedDict()
        """Times of the reports that have come last, by their number."""
        self._next: int | None = None
        self._missing: dict[int, tuple[int, float]] = {}
        """Requests of each missing photo, and the time of the next one."""
        self.lost_count = 0
        self._count, self._is_timeless = 0, False

    def is_new(self, index: int, stamp: int, now_s: float) -> bool:
        """Takes a report. Returns whether it is of a picture that was not reported before.

        `stamp` tells it from another one of its number: its time since boot or in UTC; 0 where the camera sends none.
        """
        before = self._known.get(index)
        if before == stamp:
            return False
        self._is_timeless = stamp == 0
        if before is not None:  # the same number at another time: its numbers have begun again
            self.restart()
        self._known[index] = stamp
        while len(self._known) > MOST_KNOWN_PHOTOS:
            self._known.popitem(last=False)
        if self._missing.pop(index, None) is None and index >= 0:
            self._expect(index, now_s)
        return True

    def on_count(self, count: int, now_s: float) -> None:
        """Takes how many pictures the camera says that it has taken.

        A camera that sends no times shows by this alone that it has booted.
        """
        if self._is_timeless and count < self._count:
            self.restart()
        self._count = count
        if self._next is not None and self._next < count <= self._next + LARGEST_GAP_PHOTOS:
            self._miss(range(self._next, count), now_s)
            self._next = count

    def restart(self) -> None:
        """Takes that the camera has booted. What was missing is lost."""
        self.lost_count += len(self._missing)
        self._known.clear()
        self._missing.clear()
        self._next = None

    def tick(self, now_s: float) -> None:
        """Requests what is missing and due."""
        for index, (tries_count, next_s) in list(self._missing.items()):
            if now_s < next_s:
                continue
            if tries_count >= TRIES_COUNT:
                del self._missing[index]
                self.lost_count += 1
            else:
                self._missing[index] = (tries_count + 1, now_s + RETRY_S)
                self._request(index, tries_count)

    def _expect(self, index: int, now_s: float) -> None:
        if self._next is None or index >= self._next:
            if self._next is not None and index <= self._next + LARGEST_GAP_PHOTOS:
                self._miss(range(self._next, index), now_s)
            self._next = index + 1

    def _miss(self, indexes: range, now_s: float) -> None:
        room = MOST_MISSING_REPORTS - len(self._missing)
        self.lost_count += max(0, len(indexes) - room)
        for index in indexes[max(0, len(indexes) - max(room, 0)) :]:
            self._missing[index] = (0, now_s)
