"""Plays a recording: takes its events when they are due, and publishes a moment at each recorded update."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator, Sequence

from typing_extensions import override

from ual.errors import UalError
from ual.types import Frame
from ual_daemon import logs
from ual_daemon.backends.base import Clock
from ual_daemon.backends.mavlink.playback import Playback
from ual_daemon.backends.values import Condition, Packet, Snapshot
from ual_daemon.replay.moment import ReplayMoment, decoded, reported
from ual_daemon.replay.renaming import renamed, renamed_frame
from ual_daemon.replay.source import Event, RecordedFrames, RecordedSample, SentSetpoint

_log = logging.getLogger(__name__)

_UPDATE_S = 0.05
"""The longest interval between two updates, where the recording does not say when they were."""
_REPLAY_PAUSE_S = 30.0
"""Seconds between the end and the next beginning of a recording that is played again. No value stays fresh for so long,
so nothing of the end is taken for the beginning.
"""
_SHORTEST_SLEEP_S = 0.001
"""Shorter waits are left out; longer ones make up for them."""
_ENDED_TICK_S = 0.1
ENDED = "the recording has ended"


class ReplayClock(Clock):
    """The time of the recording: that of what was played last. It stands still where the computer is too slow."""

    def __init__(self) -> None:
        self.time_s = 0.0
        self.utc_s = 0.0

    @override
    def now_s(self) -> float:
        return self.time_s


class Player:
    """Plays on one thread until it is closed."""

    def __init__(
        self,
        open_events: Callable[[], Iterator[Event]],
        new_playback: Callable[[], Playback] | None,
        names: tuple[str, str],
        *,
        speed_factor: float,
        begin_s: float,
        is_looping: bool,
        has_samples: bool,
    ) -> None:
        """Without `new_playback` nothing is decoded. `names` are the namespaces of the recording, and now."""
        self.clock = ReplayClock()
        self.moment = ReplayMoment(Snapshot(0.0))
        self.playback = None if new_playback is None else new_playback()
        self._open_events = open_events
        self._new_playback = new_playback
        self._names = names
        self._speed_factor = speed_factor
        self._begin_s = begin_s
        self._is_looping = is_looping
        self._has_samples = has_samples
        self._on_update: Callable[[ReplayMoment], None] = lambda _: None
        self._on_frames: Callable[[Sequence[Frame]], None] = lambda _: None
        self._closing = threading.Event()
        self._offset_s = 0.0
        self._updated_s = float("-inf")
        self._pose: object = None
        self._thread = threading.Thread(target=self._run, name=f"replay {names[1]}", daemon=True)

    def open(self, on_update: Callable[[ReplayMoment], None], on_frames: Callable[[Sequence[Frame]], None]) -> None:
        """Begins to play."""
        self._on_update, self._on_frames = on_update, on_frames
        self._thread.start()

    def close(self) -> None:
        """Ends."""
        self._closing.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join()

    def _run(self) -> None:
        try:
            while not self._closing.is_set():
                self._play()
                if not self._is_looping:
                    break
                self._begin_again()
        except Exception as error:  # noqa: BLE001  whatever a broken file leads to
            _log.error("the recording cannot be played on: %s", error, exc_info=not isinstance(error, UalError))
        self._stand_still()

    def _play(self) -> None:
        """Plays the recording once."""
        begin_wall_s: float | None = None
        for event in self._open_events():
            is_shown = event.time_s >= self._begin_s
            if is_shown:
                begin_wall_s = time.monotonic() if begin_wall_s is None else begin_wall_s
                due_s = begin_wall_s + (event.time_s - self._begin_s) / self._speed_factor
                wait_s = due_s - time.monotonic()
                if wait_s > _SHORTEST_SLEEP_S:
                    self._closing.wait(wait_s)
            if self._closing.is_set():
                return
            self._on_event(event, event.time_s + self._offset_s, is_shown=is_shown)

    def _on_event(self, event: Event, time_s: float, *, is_shown: bool) -> None:
        """Takes an event. What was before the wanted beginning is decoded, but not shown."""
        self.clock.time_s = time_s
        playback = self.playback
        if isinstance(event, RecordedFrames):
            self._on_frames([renamed_frame(each, *self._names) for each in event.frames])
        elif isinstance(event, RecordedSample):
            if is_shown:
                self._publish_recorded(event, time_s)
        elif playback is None:
            return
        elif isinstance(event, SentSetpoint):
            playback.on_setpoint(time_s, event.position)
        else:
            self._receive(playback, event._replace(time_s=time_s))
            if is_shown and not self._has_samples:
                self._publish_if_due(playback, time_s)

    def _receive(self, playback: Playback, packet: Packet) -> None:
        self.clock.utc_s = packet.utc_s
        playback.receive(packet)

    def _publish_recorded(self, event: RecordedSample, time_s: float) -> None:
        sample = renamed(event.telemetry, *self._names)
        if self.playback is None:
            self.clock.utc_s = sample.stamp_s or self.clock.utc_s
            self._publish(reported(sample, time_s))
        else:
            self._publish(decoded(self.playback.snapshot(time_s), sample))

    def _publish_if_due(self, playback: Playback, time_s: float) -> None:
        pose = playback.pose
        if pose is not self._pose or time_s - self._updated_s >= _UPDATE_S:
            self._pose = pose
            self._publish(ReplayMoment(playback.snapshot(time_s)))

    def _publish(self, moment: ReplayMoment) -> None:
        self._updated_s = moment.snapshot.time_s
        self.moment = moment
        self._on_update(moment)

    def _begin_again(self) -> None:
        self._offset_s = self.clock.time_s + _REPLAY_PAUSE_S
        self.clock.time_s = self._offset_s
        if self._new_playback is not None:
            self.playback = self._new_playback()
        self._publish(
            ReplayMoment(Snapshot(self._offset_s, condition=Condition(status_text="the recording begins again")))
        )

    def _stand_still(self) -> None:
        """Reports until it is closed that nothing is received any more."""
        if not self._closing.is_set():
            logs.event(_log, logging.INFO, "replay_ended", after_s=round(self.clock.time_s, 1))
        while not self._closing.wait(_ENDED_TICK_S):
            self.clock.time_s += _ENDED_TICK_S
            last = self.moment.snapshot.at(self.clock.time_s)
            self._publish(ReplayMoment(last._replace(condition=last.condition._replace(status_text=ENDED))))
