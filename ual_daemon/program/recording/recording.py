"""The daemon's recording (``--record``): what is recorded of each UAV, and when it begins and ends."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from typing_extensions import override

from ual.errors import UalError
from ual.recording.carried import PayloadRecorder
from ual.recording.frames import FRAMES_CHECK_S, FrameChanges
from ual.recording.log import RecordingHandler
from ual.recording.pictures import PictureRecorder
from ual.recording.recorder import QueueFigures, Recorder, Turnover
from ual.recording.telemetry import TelemetryTopics
from ual.types import Info, Telemetry
from ual_daemon import logs
from ual_daemon.backends.values import Packet, Setpoint
from ual_daemon.program.recording.calls import CallTopic
from ual_daemon.program.recording.packets import PacketTopics
from ual_daemon.program.recording.setpoints import SetpointTopic
from ual_daemon.server.call_log import CallObserver, CallRecord
from ual_daemon.services._derived import Cameras, Gimbals, Gripper

if TYPE_CHECKING:
    from ual_daemon.choice import ServedVehicle

_log = logging.getLogger(__name__)

_PICTURE_S = 1.0
"""Seconds for which the end of the daemon waits for a picture that is in progress."""
_INFO_S = 1.0
"""Seconds between two checks whether the vehicle's info has changed."""


class UavRecording(CallObserver):
    """Records one UAV."""

    def __init__(self, vehicle: ServedVehicle, recorder: Recorder, *, is_raw: bool, has_pictures: bool) -> None:
        self._vehicle = vehicle
        self._recorder = recorder
        self._clock = recorder.clock
        self._telemetry = TelemetryTopics(vehicle.ns)
        self._calls = CallTopic(vehicle.ns)
        self._setpoints = SetpointTopic(vehicle.ns)
        self._packets = PacketTopics(vehicle.ns, recorder.clock)
        self._info: Info | None = None
        self._info_due_ns = 0
        self._frames = FrameChanges(vehicle.ns)
        self._check_ns = 0
        vehicle.subscribe(self._on_sample)
        vehicle.observe_setpoints(self._on_setpoint)
        if is_raw and not vehicle.observe_packets(self._on_packet):
            logs.event(_log, logging.WARNING, "no_packets", ns=vehicle.ns, backend=vehicle.backend_name)
        self._pictures = PictureRecorder(vehicle.ns, Cameras(vehicle), recorder) if has_pictures else None
        gripper = Gripper(vehicle, str)  # without a lease: nothing is ordered
        self._carried = PayloadRecorder(vehicle.ns, Gimbals(vehicle), gripper, vehicle.frames, recorder)
        recorder.at_each_file(self._repeat)

    def start(self) -> None:
        """Begins to ask for what it carries, and for pictures, if they are wanted."""
        self._carried.start()
        if self._pictures is None:
            return
        try:
            self._pictures.start()
        except UalError as error:
            logs.event(_log, logging.WARNING, "no_pictures", ns=self._vehicle.ns, why=error)
            self._pictures = None

    def close(self) -> None:
        """Ends what `start` has begun, and logs what of it is not complete."""
        self._carried.close(0.0)  # what comes later is not recorded
        if self._pictures is None:
            return
        self._pictures.close(_PICTURE_S)
        count, without_count, why = self._pictures.figures
        if without_count:
            event = {"ns": self._vehicle.ns, "pictures": count, "without_bytes": without_count, "why": why}
            logs.event(_log, logging.WARNING, "pictures_without_bytes", **event)

    def _on_sample(self, sample: Telemetry) -> None:
        now_ns = self._clock.now_ns()
        self._recorder.put(self._telemetry.write_sample, now_ns, sample)
        if now_ns >= self._check_ns:
            self._check_ns = now_ns + round(FRAMES_CHECK_S * 1e9)
            frames = self._frames.due(self._vehicle.frames(), now_ns)
            if frames:
                self._recorder.put(self._telemetry.write_frames, now_ns, frames)
        if now_ns >= self._info_due_ns:
            self._info_due_ns = now_ns + round(_INFO_S * 1e9)
            info = self._vehicle.info()
            if info != self._info:
                self._info = info
                self._recorder.put(self._telemetry.write_info, now_ns, info)

    def _on_setpoint(self, setpoint: Setpoint) -> None:
        self._recorder.put(self._setpoints.write, self._clock.now_ns(), setpoint)

    def _on_packet(self, packet: Packet) -> None:
        age_s = self._vehicle.clock.now_s() - packet.time_s
        self._recorder.put(self._packets.write, self._clock.now_ns() - round(age_s * 1e9), packet, len(packet.data))

    @override
    def on_request(self, method: str) -> None:
        return None

    @override
    def on_call(self, record: CallRecord, before: object) -> None:
        size_bytes = len(record.request or b"") + len(record.response or b"")
        self._recorder.put(self._calls.write, record.at_ns + self._clock.offset_ns, record, size_bytes)

    def _repeat(self) -> None:
        """Has recorded again in the next file what is recorded rarely."""
        self._telemetry.begin_file()
        self._info = None
        self._info_due_ns = 0
        self._frames.forget()


class DaemonRecording:
    """The recording of all UAVs of this process, from `start` to `close`.

    `text` makes the text of a line of the log.
    """

    def __init__(
        self,
        directory: Path,
        vehicles: Sequence[ServedVehicle],
        text: Callable[[logging.LogRecord], str],
        turnover: Turnover,
        *,
        is_raw: bool,
        has_pictures: bool = False,
    ) -> None:
        """Opens the first file.

        Raises:
            OSError: It cannot be written.

        """
        self._recorder = Recorder(directory, vehicles[0].ns, turnover)
        self._handler = RecordingHandler(self._recorder, text)
        self._uavs = {
            vehicle.ns: UavRecording(vehicle, self._recorder, is_raw=is_raw, has_pictures=has_pictures)
            for vehicle in vehicles
        }

    def start(self) -> None:
        """Begins to write; to be called before the vehicles are opened."""
        logging.getLogger().addHandler(self._handler)
        self._recorder.start()
        for each in self._uavs.values():
            each.start()
        logs.event(_log, logging.INFO, "recording", file=self._recorder.path)

    @property
    def figures(self) -> QueueFigures:
        """Figures of the queue of messages that wait to be written."""
        return self._recorder.figures

    @property
    def checks(self) -> tuple[str, ...]:
        """Human-readable failing checks of the recording: none while it records."""
        trouble = self._recorder.trouble
        return (f"the recording stands still: {trouble}",) if trouble else ()

    def tell_changes(self, callback: Callable[[], object]) -> None:
        """Calls back when `checks` has changed, on the recorder's thread."""
        self._recorder.on_change = callback

    def observer(self, ns: str) -> CallObserver:
        """Returns what observes the calls for a UAV."""
        return self._uavs[ns]

    def close(self) -> None:
        """Writes what is left, and ends the file."""
        for each in self._uavs.values():
            each.close()
        logging.getLogger().removeHandler(self._handler)
        self._recorder.close()
