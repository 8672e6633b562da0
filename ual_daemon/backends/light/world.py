"""The world of the light simulation: its time and its vehicles.

One thread steps all vehicles of a world. With a speed factor of 0 that thread pauses, and `step` advances the time.
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
from ual_daemon import logs
from ual_daemon.backends.engine.contained import ErrorBarrier
from ual_daemon.backends.engine.link_watch import LinkWatch
from ual_daemon.backends.light.painter import Painter
from ual_daemon.backends.light.physics import NO_CONDITIONS_CODE, SIM_STEP_S
from ual_daemon.backends.light.settings import LightSettings
from ual_daemon.backends.light.single import Single

if TYPE_CHECKING:
    from ual_daemon.backends.light.fleet import Fleet

_log = logging.getLogger(__name__)

Vehicles: TypeAlias = "Single | Fleet"
"""All vehicles of a world; each has its row in every column."""

_MOST_LATE_STEPS = 10
_LONGEST_COMMANDED_STEP_S = 3600.0
_MOST_STEPS_PER_UPDATE = 5
"""10 updates a second: fewer are not enough to fly."""
_BUSY_TIME_SHARE = 0.7
"""The part of its time that a step may use. The rest is for the server, which needs Python's lock, too."""
_IDLE_TIME_SHARE = 0.5
"""Updates become more frequent only if a step would then use less than this. The distance to `_BUSY_TIME_SHARE` keeps
the rate from switching back and forth.
"""
LAG_S = 0.5
"""Simulated time that is further behind than this is reported."""
_SMOOTHED_STEPS_COUNT = 25.0
_LARGEST_TIME_SHARE = 2.0
"""Larger values count as this: they come from a process that was stopped for a moment, not from a slow computer."""


class _Listener(NamedTuple):
    """See `World.listen`."""

    on_step: Callable[[], None]
    is_needed: Callable[[], bool]


class Thinning:
    """Reduces how often vehicles are updated, if the computer is too slow to update each of them after every step.

    Stepping many vehicles is cheap, updating them is not. Without this, simulated time would fall behind real time, and
    telemetry with it. With it the references of each vehicle become coarser instead.
    """

    def __init__(self) -> None:
        self.every = 1
        """A vehicle is updated after each step (1), after every second step (2), and so on."""
        self._largest = 1
        self._share = 0.0

    def add(self, share: float) -> bool:
        """Adds a measurement: which part of its time a step used, including updates. Returns whether `every` has become
        larger than ever before.
        """
        self._share += (min(share, _LARGEST_TIME_SHARE) - self._share) / _SMOOTHED_STEPS_COUNT
        if self._share > _BUSY_TIME_SHARE and self.every < _MOST_STEPS_PER_UPDATE:
            every = self.every + 1
        elif self.every > 1 and self._share * self.every / (self.every - 1) < _IDLE_TIME_SHARE:
            every = self.every - 1
        else:
            return False
        self._share *= self.every / every
        self.every = every
        is_largest, self._largest = every > self._largest, max(every, self._largest)
        return is_largest


class World:
    """Simulated time and its vehicles. This is also the clock of their backends.

    Callbacks run after a step, on the thread that steps. The only lock that is held then is the one that lets one
    thread step at a time. A vehicle that has not changed, and for whose update nobody waits, costs only its row in the
    vectors.
    """

    def __init__(self, speed_factor: float = 1.0, *, skips_lag: bool = False) -> None:
        self.lock = threading.Lock()
        self.watch = LinkWatch("light", math.inf)
        """Of the links to all vehicles, which are never lost: a fault of one is its own."""
        self.fleet: Vehicles = Single()
        self.painter = Painter()
        """Of the pictures of all vehicles."""
        self.epoch_s = time.time()
        """The stamp of the first step; later where a lag was skipped."""
        self.lag_s = 0.0
        """Seconds by which simulated time lags behind the speed factor."""
        self._skips_lag = skips_lag
        self._reported_lag_s = LAG_S / 2.0
        self._steps = 0
        self._stepping = threading.RLock()
        self._listeners: dict[int, _Listener] = {}
        self._called: int | None = None
        """Number of the caller whose callback may be running now."""
        self._speed_factor = speed_factor
        self._thinning = Thinning()
        self._contained = ErrorBarrier("an update of a light UAV")
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None

    def now_s(self) -> float:
        """Returns the simulated seconds since the world was made."""
        return self._steps * SIM_STEP_S

    @property
    def steps(self) -> int:
        """The number of steps so far."""
        return self._steps

    def add(self, settings: LightSettings) -> int:
        """Adds a vehicle. Returns its row in the fleet."""
        with self.lock:
            if isinstance(self.fleet, Single) and self.fleet.count:
                from ual_daemon.backends.light.fleet import Fleet  # imported late: numpy takes 10 MiB and 50 ms

                self.fleet = Fleet(self.fleet)
            return self.fleet.add(settings)

    def set_wind(self, index: int, velocity_m_s: Vector3) -> None:
        """Sets the wind at one vehicle."""
        with self.lock:
            x, y, z = velocity_m_s
            self.fleet.wind[index] = (x, y, z)

    def listen(self, index: int, on_step: Callable[[], None], is_needed: Callable[[], bool] = lambda: True) -> None:
        """From now on calls back after the next step, and after each step that has changed the vehicle's conditions
        (mode, armed, landed, has a position). It also calls back after each step for which `is_needed` returns True
        (but see `Thinning`). Time runs while there is any listener.
        """
        with self._changed:
            self._listeners[index] = _Listener(on_step, is_needed)
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="light-world", daemon=True)
                self._thread.start()
            self._changed.notify_all()
        # Reset after the listener was added: before that, a step could mark the conditions as reported without a call.
        with self.lock:
            self.fleet.reported_conditions[index] = NO_CONDITIONS_CODE

    def unlisten(self, index: int) -> None:
        """Ends `listen`. Once this has returned, no callback runs any more."""
        with self._changed:
            self._listeners.pop(index, None)
            thread = self._thread
            is_last = not self._listeners
            if is_last:
                self._thread = None
            self._changed.notify_all()
        if is_last:
            self.painter.close()
        if threading.current_thread() is thread:
            return  # this is a callback of a step: the thread ends after that step
        if is_last and thread is not None:
            thread.join()
        if self._called == index:
            with self._stepping:
                pass

    @property
    def speed_factor(self) -> float:
        """Speed of simulated time, relative to real time; 0: it stands still."""
        return self._speed_factor

    def set_speed_factor(self, speed_factor: float) -> None:
        """Sets how fast simulated time runs: 0 to 100, or infinity. With 0 it stands still once this has returned.

        Raises:
            InvalidArgumentError: The factor is out of range.
        """
        if not (0.0 <= speed_factor <= 100.0 or speed_factor == math.inf):
            raise InvalidArgumentError(
                f"speed_factor: {speed_factor:g} is neither from 0 to 100 nor infinity", {"field": "speed_factor"}
            )
        with self._changed:
            self._speed_factor = speed_factor
            self.lag_s, self._reported_lag_s = 0.0, LAG_S / 2.0
            self._changed.notify_all()
        with self._stepping:
            pass

    def step(self, duration_s: float) -> None:
        """Advances time that stands still by a duration (rounded to steps). Blocks until that is done.

        Raises:
            WrongStateError: The time runs by itself.
            InvalidArgumentError: The duration is out of range.
        """
        if self._speed_factor != 0.0:
            raise WrongStateError("the simulated time runs by itself; set the speed factor to 0 to step it")
        if not 0.0 < duration_s <= _LONGEST_COMMANDED_STEP_S:
            raise InvalidArgumentError(
                f"duration_s: {duration_s:g} is not above 0 and at most {_LONGEST_COMMANDED_STEP_S:g}",
                {"field": "duration_s"},
            )
        for _ in range(max(1, round(duration_s / SIM_STEP_S))):
            self._step_once()

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Keeps all threads from stepping while the block runs."""
        with self._stepping:
            yield

    def _step_once(self, every: int = 1) -> None:
        """Steps once, and updates every n-th vehicle (n is `every`), so that each is updated in every n-th step; see
        `Thinning`.
        """
        with self._stepping:
            with self.lock:
                self._steps += 1
                self.fleet.step(self.now_s())
                changed = self.fleet.changed()
            for index, listener in list(self._listeners.items()):
                self._called = index  # first this: `unlisten` removes it, and then looks whether it is called
                if index not in self._listeners:
                    continue
                if index in changed or ((self._steps + index) % every == 0 and listener.is_needed()):
                    try:  # as `ErrorBarrier.call`, without its call for each UAV
                        listener.on_step()
                    except Exception as error:  # noqa: BLE001 - the other UAVs go on
                        self._contained.tell(error)
            self._called = None

    def _step_in_time(self, step_s: float) -> None:
        """Steps several vehicles, and thins their updates if that takes too much of `step_s`."""
        thinning, begin_s = self._thinning, time.monotonic()
        self._step_once(thinning.every)
        if thinning.add((time.monotonic() - begin_s) / step_s):
            _log.warning(
                "this computer is too slow for %d UAVs in one process: references and telemetry of each are updated "
                "every %g s instead of every %g s while that lasts; fly fewer, or on a faster one",
                len(self._listeners),
                thinning.every * step_s,
                step_s,
            )

    def _fall_behind(self, lost_s: float) -> None:
        """Counts simulated time that will not be caught up, and tells it: each time that it has doubled."""
        self.lag_s += lost_s
        if self.lag_s <= max(LAG_S, 0.0 if self._skips_lag else 2.0 * self._reported_lag_s):
            return
        if self._skips_lag:
            skipped_s, self.lag_s = self.lag_s, 0.0
            self.epoch_s += skipped_s  # stamps only: the flight goes on from where it is
            logs.event(_log, logging.WARNING, "simulated_time_skipped", skipped_s=round(skipped_s, 2))
            return
        self._reported_lag_s = self.lag_s
        advice = "this computer is too slow; with light.skip_lag=true the stamps skip ahead"
        logs.event(_log, logging.WARNING, "simulated_time_behind", lag_s=round(self.lag_s, 2), advice=advice)

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
                    # Catches up at most this many steps. On a computer that is too slow, simulated time falls behind.
                    earliest_s = now_s - _MOST_LATE_STEPS * SIM_STEP_S / factor
                    lost_s = max(0.0, earliest_s - due_s) * factor
                    due_s = max(due_s, earliest_s) + SIM_STEP_S / factor
            if factor == math.inf:
                time.sleep(0)  # lets other threads run
            elif lost_s:
                self._fall_behind(lost_s)
            with self._stepping:
                factor = self._speed_factor
                if 0.0 < factor <= 1.0 and len(self._listeners) > 1:
                    self._step_in_time(SIM_STEP_S / factor)
                elif factor != 0.0:
                    self._step_once()
