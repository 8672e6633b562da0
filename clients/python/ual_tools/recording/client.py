"""Records what a client sees (``ual record``): the telemetry of UAVs, as fast as their daemons send it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from ual.errors import InvalidArgumentError
from ual.interface import Uav
from ual.recording.frames import FrameRecording
from ual.recording.recorder import Recorder
from ual.recording.telemetry import TelemetryTopics
from ual.types import Info, Telemetry

if TYPE_CHECKING:
    from ual.recording.pictures import PictureRecorder


class ClientRecording:
    """One file of telemetry of any number of UAVs. Its members may be called from any thread."""

    def __init__(self, directory: Path, name: str) -> None:
        """Opens the file, whose name begins with `name`.

        Raises:
            InvalidArgumentError: It cannot be written.

        """
        try:
            self._recorder = Recorder(directory, name)
        except OSError as error:
            why = f"cannot record into {directory}: {error.strerror or error}"
            raise InvalidArgumentError(why, {"field": "directory"}) from None
        self._lock = threading.Lock()
        self._topics: dict[str, TelemetryTopics] = {}
        self._described: dict[str, Info] = {}
        self._pictures: list[PictureRecorder] = []
        self._recorder.at_each_file(self._repeat)
        self.samples_count = 0
        """Samples that arrived."""
        self.missed_count = 0
        """Samples that the daemons had to leave out, because this computer was too slow."""
        self._recorder.start()

    @property
    def path(self) -> Path:
        """The file that is being written."""
        return self._recorder.path

    @property
    def uavs(self) -> list[str]:
        """The UAVs that are recorded."""
        return sorted(self._topics)

    @property
    def lost_count(self) -> int:
        """Records that were dropped, because the disk was too slow."""
        return self._recorder.lost_count

    @property
    def trouble(self) -> str:
        """Why nothing can be written now, human-readable; empty while it records."""
        return self._recorder.trouble

    def put(self, ns: str, sample: Telemetry) -> None:
        """Records a sample of a UAV."""
        with self._lock:
            self.samples_count += 1
            self.missed_count += sample.missed_count
            topics = self._topics.setdefault(ns, TelemetryTopics(ns))
        self._recorder.put(topics.write_sample, self._recorder.clock.now_ns(), sample)

    def describe(self, uav: Uav) -> None:
        """Records the present identity of a UAV."""
        with self._lock:
            topics = self._topics.setdefault(uav.ns, TelemetryTopics(uav.ns))
        self._described[uav.ns] = uav.info()
        self._put_description(uav.ns, topics)

    def _put_description(self, ns: str, topics: TelemetryTopics) -> None:
        now_ns = self._recorder.clock.now_ns()
        self._recorder.put(topics.write_info, now_ns, self._described[ns])

    def _repeat(self) -> None:
        """Has recorded again in the next file what is recorded once."""
        for ns in list(self._described):
            self._topics[ns].begin_file()
            self._put_description(ns, self._topics[ns])

    def subscribe(self, uav: Uav) -> Callable[[], None]:
        """Records a UAV until the function that it returns is called."""
        self.describe(uav)
        subscription = uav.subscribe(lambda sample: self.put(uav.ns, sample))
        frames = FrameRecording(uav.ns, uav.frames, self._topics[uav.ns], self._recorder)

        def close() -> None:
            subscription.close()
            frames.close()

        return close

    def record_pictures(self, uav: Uav) -> Callable[[], None]:
        """Records the pictures that a UAV takes, until the function that it returns is called.

        Raises:
            UalError: The cameras do not answer, or there are none.

        """
        from ual.recording.pictures import PictureRecorder

        pictures = PictureRecorder(uav.ns, uav.cameras, self._recorder)
        pictures.start()
        self._pictures.append(pictures)
        return pictures.close

    def record_carried(self, uav: Uav) -> Callable[[], None]:
        """Records what a UAV carries, if it carries something, until the function that it returns is called."""
        from ual.recording.carried import PayloadRecorder

        carried = PayloadRecorder(uav.ns, uav.gimbals, uav.gripper, uav.frames, self._recorder)
        carried.start()
        return carried.close

    @property
    def pictures(self) -> tuple[int, int, str]:
        """Recorded pictures: their number, the number of those without their bytes, and why the last one of these
        is.
        """
        figures = [each.figures for each in self._pictures]
        reason = next((each.reason for each in reversed(figures) if each.without_bytes_count), "")
        return sum(each.photos_count for each in figures), sum(each.without_bytes_count for each in figures), reason

    def close(self) -> None:
        """Ends the file."""
        self._recorder.close()
