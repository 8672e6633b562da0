"""The world of the light simulation: time, and the vehicles that live in it.

One thread runs all vehicles of a world; with a speed factor of 0 it rests, and `step` runs the time.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from ual.errors import InvalidArgumentError, WrongStateError
from ual.geometry import Vector3
from ual_daemon.backends.light.physics import NEVER_TOLD, STEP_S
from ual_daemon.backends.light.settings import LightSettings
from ual_daemon.backends.light.single import Single

if TYPE_CHECKING:
    from ual_daemon.backends.light.fleet import Fleet

_log = logging.getLogger(__name__)

Vehicles: TypeAlias = "Single | Fleet"
"""All vehicles of a world; each has its row in every column."""

_LATEST_STEPS = 10
_MAX_STEP_S = 3600.0
_MOST_STEPS = 5
"""10 updates a second: fewer are no flying."""
_TOO_MUCH = 0.7
"""The part of its time that a step may take: Python's lock is for the server, too."""
_PLENTY = 0.5
"""Less than this it must take where there are more updates again, so that they do not come and go."""
_SMOOTHING_STEPS = 25.0
_MOST_SHARE = 2.0
"""A process that was stopped for a moment says nothing of how fast the computer is."""


class _Listener(NamedTuple):
    """See `World.listen`."""

    on_step: Callable[[], None]
    is_needed: Callable[[], bool]


class Thinning:
    """Lets vehicles be updated after every second step only, or fewer, where a computer is too slow for more.

    Steps of many vehicles are cheap, updates are not. Without this, simulated time would fall behind the wall's, and
    subscribers with it; with it the references of each vehicle become coarser instead.
    """

    def __init__(self) -> None:
        self.every = 1
        """After every how manieth step."""
        self._most = 1
        self._share = 0.0

    def took(self, share: float) -> bool:
        """Takes what part of its time a step took, updates included. True when `every` is more than it ever was."""
        self._share += (min(share, _MOST_SHARE) - self._share) / _SMOOTHING_STEPS
        if self._share > _TOO_MUCH and self.every < _MOST_STEPS:
            every = self.every + 1
        elif self.every > 1 and self._share * self.every / (self.every - 1) < _PLENTY:
            every = self.every - 1
        else:
            return False
        self._share *= self.every / every
        self.every = every
        is_most, self._most = every > self._most, max(every, self._most)
        return is_most


class World:
    """Simulated time, and the vehicles that live in it. Is the clock of their backends.

    Callbacks run after a step, on the thread that steps, with no lock held but the one that lets only one thread step
    at a time. A vehicle of which nothing is told and that nobody waits for costs no more than its row in the vectors.
    """

    def __init__(self, speed_factor: float = 1.0) -> None:
        self.lock = threading.Lock()
        self.fleet: Vehicles = Single()
        self.epoch_s = time.time()
        self._steps = 0
        self._stepping = threading.RLock()
        self._listeners: dict[int, _Listener] = {}
        self._speed_factor = speed_factor
        self._thinning = Thinning()
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None

    def now_s(self) -> float:
        """Simulated seconds since the world began."""
        return self._steps * STEP_S

    @property
    def steps(self) -> int:
        """How many steps were made."""
        return self._steps

    def add(self, settings: LightSettings) -> int:
        """Adds a vehicle; its row in the fleet."""
        with self.lock:
            if isinstance(self.fleet, Single) and self.fleet.count:
                from ual_daemon.backends.light.fleet import Fleet  # with numpy: 10 MiB, 50 ms

                self.fleet = Fleet(self.fleet)
            return self.fleet.add(settings)

    def wind_to(self, index: int, velocity_m_s: Vector3) -> None:
        """Lets wind blow on one vehicle."""
        with self.lock:
            x, y, z = velocity_m_s
            self.fleet.wind[index] = (x, y, z)

    def listen(self, index: int, on_step: Callable[[], None], is_needed: Callable[[], bool] = lambda: True) -> None:
        """From now on calls back after the first step, after each in which the conditions of the vehicle have changed,
        and after each for which `is_needed` says so (but see `Thinning`); the world runs while anyone listens.
        """
        with self._changed:
            self._listeners = {**self._listeners, index: _Listener(on_step, is_needed)}
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="light-world", daemon=True)
                self._thread.start()
            self._changed.notify_all()
        # After that: a step in between would take it as told, and tell nobody.
        with self.lock:
            self.fleet.told[index] = NEVER_TOLD

    def unlisten(self, index: int) -> None:
        """Ends `listen`; no call comes once this returns."""
        with self._changed:
            self._listeners = {other: each for other, each in self._listeners.items() if other != index}
            thread = self._thread
            is_last = not self._listeners
            if is_last:
                self._thread = None
            self._changed.notify_all()
        if threading.current_thread() is thread:
            return  # called back from a step: it ends with it
        if is_last and thread is not None:
            thread.join()
        with self._stepping:
            pass

    @property
    def speed_factor(self) -> float:
        """How fast the time runs against the wall; 0 stands still."""
        return self._speed_factor

    def set_speed_factor(self, speed_factor: float) -> None:
        """Lets the time run at another speed: 0 to 100, or infinity. With 0 it stands still once this returns."""
        if not (0.0 <= speed_factor <= 100.0 or speed_factor == math.inf):
            raise InvalidArgumentError(
                f"speed_factor: {speed_factor:g} is not from 0 to 100, nor infinity", {"field": "speed_factor"}
            )
        with self._changed:
            self._speed_factor = speed_factor
            self._changed.notify_all()
        with self._stepping:
            pass

    def step(self, duration_s: float) -> None:
        """Runs standing time on by a duration (to the nearest step), and returns when that is done."""
        if self._speed_factor != 0.0:
            raise WrongStateError("the simulated time runs by itself; set the speed factor to 0 to step it")
        if not 0.0 < duration_s <= _MAX_STEP_S:
            raise InvalidArgumentError(
                f"duration_s: {duration_s:g} is not above 0 and at most {_MAX_STEP_S:g}", {"field": "duration_s"}
            )
        for _ in range(max(1, round(duration_s / STEP_S))):
            self._step_once()

    @contextmanager
    def standing(self) -> Iterator[None]:
        """No step is made while the block runs."""
        with self._stepping:
            yield

    def _step_once(self, every: int = 1) -> None:
        """Updates each vehicle after every how manieth step, not all of them after the same; see `Thinning`."""
        with self._stepping:
            with self.lock:
                self._steps += 1
                self.fleet.step(self.now_s())
                changed = self.fleet.changed()
            for index, listener in self._listeners.items():
                if index in changed or ((self._steps + index) % every == 0 and listener.is_needed()):
                    listener.on_step()

    def _step_in_time(self, step_s: float) -> None:
        """A step of several vehicles that should not take longer than that."""
        thinning, begin_s = self._thinning, time.monotonic()
        self._step_once(thinning.every)
        if thinning.took((time.monotonic() - begin_s) / step_s):
            _log.warning(
                "this computer is too slow for %d UAVs in one process: references and telemetry of each are updated "
                "every %g s instead of every %g s while that lasts; fly fewer, or on a faster one",
                len(self._listeners),
                thinning.every * step_s,
                step_s,
            )

    def _run(self) -> None:
        due_s = time.monotonic()
        while True:
            with self._changed:
                if self._thread is not threading.current_thread():
                    return
                factor = self._speed_factor
                if factor == 0.0:
                    self._changed.wait()
                    due_s = time.monotonic()
                    continue
                if factor != math.inf:
                    now_s = time.monotonic()
                    if due_s > now_s:
                        self._changed.wait(due_s - now_s)
                        continue
                    # A machine that cannot keep up lets the simulated time fall behind; it does not hurry after it.
                    due_s = max(due_s, now_s - _LATEST_STEPS * STEP_S / factor) + STEP_S / factor
            if factor == math.inf:
                time.sleep(0)  # lets other threads run
            with self._stepping:
                factor = self._speed_factor
                if 0.0 < factor <= 1.0 and len(self._listeners) > 1:
                    self._step_in_time(STEP_S / factor)
                elif factor != 0.0:
                    self._step_once()
