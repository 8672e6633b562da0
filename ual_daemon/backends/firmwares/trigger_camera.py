"""The camera that the autopilot itself triggers, as a camera of the vehicle, whatever protocol passes its orders on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any

from typing_extensions import override

from ual.cameras import CameraAbility, CameraInfo, CameraStatus
from ual.errors import LinkLostError, NotSupportedError
from ual_daemon.backends import futures
from ual_daemon.backends.firmwares.triggered_photos import TriggeredPhotos
from ual_daemon.backends.offers.cameras import CameraDriver, TakenPhoto

NAME = "autopilot's trigger"
DIGICAM_CONTROL, TRIGGER_DISTANCE = 203, 206
"""Of MAV_CMD: DO_DIGICAM_CONTROL, and DO_SET_CAM_TRIGG_DIST, which may be repeated."""

Order = Callable[[str, int, tuple[float, ...]], Future[None]]
"""Passes a command to the autopilot: with a human-readable name, its id in MAV_CMD, and its parameters."""
Give = Callable[[str, Callable[[Future[Any]], None]], Future[Any]]
"""Returns a future that something ends on the thread that receives; see `Loop.run_on_loop`."""


class TriggerCamera(CameraDriver):
    """Takes pictures one by one, or by distance, which the autopilot counts.

    Args:
        number: Its number.
        trigger: Returns what it has reported; None before the link was opened.
        order: Passes a command to the autopilot.
        post: Has something done on the thread that receives.
        give: Returns a future that is ended there.
        is_up: Whether the autopilot is received.

    """

    def __init__(
        self,
        number: int,
        trigger: Callable[[], TriggeredPhotos | None],
        order: Order,
        post: Callable[[Callable[[], None]], None],
        give: Give,
        is_up: Callable[[], bool],
    ) -> None:
        self._number = number
        self._trigger = trigger
        self._order = order
        self._post = post
        self._give = give
        self._is_up = is_up

    @property
    @override
    def info(self) -> CameraInfo:
        return CameraInfo(self._number, NAME, frozenset({CameraAbility.PHOTO}), self._is_up())

    @override
    def status(self) -> Future[CameraStatus]:
        future: Future[CameraStatus] = Future()
        trigger = self._trigger()
        if trigger is None:
            future.set_result(CameraStatus())
        else:
            distance_m = trigger.distance_m
            future.set_result(
                CameraStatus(
                    is_taking_photos=distance_m is not None,
                    distance_m=distance_m,
                    photos_count=trigger.photos.count,
                    missed_count=trigger.missed_count,
                )
            )
        return future

    @override
    def photos(self, first: int) -> Sequence[TakenPhoto]:
        trigger = self._trigger()
        return [] if trigger is None else trigger.photos.since(first)

    @override
    def take_photo(self) -> Future[TakenPhoto]:
        """Waits for the report, whatever is answered to the order, unless that is refused."""
        what, trigger = "take a photo", self._trigger()
        if trigger is None:
            return futures.failed(LinkLostError(f"cannot {what}: no autopilot is heard"))
        future: Future[TakenPhoto] = self._give(what, trigger.await_photo)
        ordered = self._order(what, DIGICAM_CONTROL, (0.0, 0.0, 0.0, 0.0, 1.0))

        def on_answer(answered: Future[None]) -> None:
            error = None if answered.cancelled() else answered.exception()
            if error is not None:
                self._post(lambda: _fail(future, error))

        ordered.add_done_callback(on_answer)
        future.add_done_callback(lambda _: ordered.cancel())
        return future

    @override
    def start_interval(self, interval_s: float, count: int) -> Future[None]:
        return futures.failed(NotSupportedError(f"camera {self._number} ({NAME}) takes no pictures by time"))

    @override
    def start_distance(self, distance_m: float) -> Future[None]:
        return self._set_distance("take photos by distance", distance_m)

    @override
    def stop_photos(self) -> Future[None]:
        return self._set_distance("stop taking photos", None)

    def _set_distance(self, what: str, distance_m: float | None) -> Future[None]:
        once = 0.0 if distance_m is None else 1.0
        ordered = self._order(what, TRIGGER_DISTANCE, (distance_m or 0.0, 0.0, once))

        def on_answer(answered: Future[None]) -> None:
            trigger = self._trigger()
            if trigger is not None and not answered.cancelled() and answered.exception() is None:
                trigger.distance_m = distance_m

        ordered.add_done_callback(on_answer)
        return ordered


def _fail(future: Future[TakenPhoto], error: BaseException) -> None:
    if not future.done():
        futures.fail(future, error)
