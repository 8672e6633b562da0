"""Health of an autopilot by its own report: ready to arm or not, failing checks, and the quality of the link."""

from __future__ import annotations

import math
from collections.abc import Callable

from ual.types import Health
from ual_daemon.backends.firmwares.numbers import sensor_names
from ual_daemon.backends.firmwares.px4_events import Event

LINK_PERIOD_S = 1.0
"""Seconds between two computations of the link's quality."""
TEXTS_S = 40.0
"""ArduPilot repeats what fails before arming every 30 s."""
READY_TEXT_S = 1.5
"""Seconds for which a text of a check counts though it is reported to be ready: its SYS_STATUS may be from before the
check.
"""
_MOST_TEXTS = 16
_PREARM = "PreArm: "


class HealthReport:
    """Composes the health of one autopilot. Belongs to the thread that receives."""

    def __init__(self) -> None:
        self._texts: dict[str, float] = {}
        self._checks: dict[str, None] = {}
        self._link_quality: float | None = None
        self._next_link_s = -math.inf
        self._known: tuple[object, ...] = ()
        """Inputs of the newest health; empty where the checks have changed since."""
        self._health = Health()

    def on_text(self, text: str, now_s: float) -> None:
        """Takes a status text: ArduPilot names what fails before arming."""
        what = text.removeprefix(_PREARM)
        if what != text and (what in self._texts or len(self._texts) < _MOST_TEXTS):
            self._texts[what] = now_s

    def on_event(self, event: Event) -> None:
        """Takes an event of PX4: each report of its checks names those that fail."""
        self._known = ()
        if event.begins_report:
            self._checks.clear()
        elif event.is_check:
            self._checks[event.text.removeprefix("check ")] = None

    def report(
        self,
        now_s: float,
        is_ready: bool | None,
        failing_sensors: int,
        loss: Callable[[], float | None],
        doubt: str = "",
    ) -> Health:
        """Returns the health; the same object while nothing has changed.

        `is_ready` is whether it is ready to arm (None: it does not say). `loss` is requested once a second; None where
        it is not known. `doubt` is what does not count before the landing.
        """
        if now_s >= self._next_link_s:
            self._next_link_s = now_s + LINK_PERIOD_S
            lost = loss()
            self._link_quality = None if lost is None else round(1.0 - lost, 3)
        known = (is_ready, failing_sensors, self._link_quality, doubt)
        if known != self._known or self._texts:  # texts become old
            self._known = known
            texts = self._fresh_texts(now_s, is_ready=is_ready)
            failing = (*sensor_names(failing_sensors), *self._checks, *texts, *([doubt] if doubt else []))
            health = Health(is_ready, failing, self._link_quality)
            self._health = self._health if health == self._health else health
        return self._health

    def _fresh_texts(self, now_s: float, *, is_ready: bool | None) -> tuple[str, ...]:
        longest_s = READY_TEXT_S if is_ready else TEXTS_S
        self._texts = {text: time_s for text, time_s in self._texts.items() if now_s - time_s <= longest_s}
        return tuple(self._texts)
