"""Frames to record, and the time of each record: all of them now and then, and at once where one was added, moved or
removed.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

from ual.errors import UalError
from ual.recording.recorder import Recorder
from ual.recording.telemetry import TelemetryTopics
from ual.shared.guard import WorkGuard
from ual.types import Frame

FRAMES_CHECK_S = 0.1
"""Seconds between two checks whether frames have changed."""
_REPEAT_PERIOD_S = 1.0
"""Seconds between two records of unchanged frames."""


class FrameChanges:
    """Says which frames are to be recorded now. Belongs to one thread, except `forget`.

    The body is left out: it is in each sample of the telemetry.
    """

    def __init__(self, ns: str) -> None:
        self._body = f"{ns}/base_link"
        self._last: Sequence[Frame] = ()
        self._due_ns = 0

    def due(self, frames: Sequence[Frame], now_ns: int) -> Sequence[Frame]:
        """Returns the frames to record now; none where nothing is due."""
        found = [frame for frame in frames if frame.frame_id != self._body]
        if found == self._last and now_ns < self._due_ns:
            return ()
        self._last, self._due_ns = found, now_ns + round(_REPEAT_PERIOD_S * 1e9)
        return found

    def forget(self) -> None:
        """Has all of them recorded again, in a further file."""
        self._due_ns = 0


class FrameRecording:
    """Records the frames of one UAV on a thread of its own, from its making to `close`. `frames` requests them."""

    def __init__(
        self, ns: str, frames: Callable[[], Sequence[Frame]], topics: TelemetryTopics, recorder: Recorder
    ) -> None:
        self._frames = frames
        self._topics = topics
        self._recorder = recorder
        self._changes = FrameChanges(ns)
        self._closing = threading.Event()
        self._guard = WorkGuard("frames")
        self._thread = threading.Thread(target=self._run, name=f"frames of {ns}", daemon=True)
        recorder.at_each_file(self._changes.forget)
        self._thread.start()

    def close(self, limit_s: float = 3.0) -> None:
        """Ends, once what is asked has been answered, or after a limit."""
        self._closing.set()
        self._thread.join(limit_s)

    def _run(self) -> None:
        while not self._closing.wait(FRAMES_CHECK_S):
            try:
                now_ns = self._recorder.clock.now_ns()
                due = self._changes.due(self._frames(), now_ns)
            except UalError:  # what cannot be had now is requested again
                continue
            except Exception as error:  # noqa: BLE001  nor does what a daemon tells end its thread
                self._guard.note(error)
                continue
            if due:
                self._recorder.put(self._topics.write_frames, now_ns, due)
