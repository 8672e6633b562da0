"""Recordings for tests: a recorded flight of `tests/data` as such a file, and one of a light UAV."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tests.ual_daemon.backends.mavlink.traces import Trace
from tests.ual_daemon.stepped import at, stepped
from ual.recording.file import File
from ual.recording.recorder import Entry, SteadyUtc
from ual.recording.telemetry import TelemetryTopics
from ual.types import Telemetry
from ual.wire import samples
from ual_daemon.backends.values import Packet
from ual_daemon.program.recording.packets import PacketTopics

BEGIN_S = 1.8e9


def raw_recording(trace: Trace, path: Path) -> Path:
    """Writes the packets of a recorded flight as a recording."""
    topics = PacketTopics("uav_1", SteadyUtc())
    file = File(path, {})
    for time_s, data in trace.frames:
        packet = Packet("mavlink", data, False, "127.0.0.1:14580", time_s, BEGIN_S + time_s)
        topics.write(file, Entry(topics.write, round((BEGIN_S + time_s) * 1e9), packet))
    file.finish()
    return path


def recording_of(samples: Sequence[Telemetry], path: Path, ns: str = "uav_1") -> Path:
    """Writes samples as a recording."""
    topics = TelemetryTopics(ns)
    file = File(path, {})
    for sample in samples:
        topics.write_sample(file, Entry(topics.write_sample, round(sample.stamp_s * 1e9), sample))
    file.finish()
    return path


def light_flight(**light: Any) -> list[Telemetry]:
    """The samples of a flight of a light UAV, with the times that a message can express."""
    with stepped(light=light) as uav:
        uav.update_each_step()
        uav.keep_samples()
        uav.run(0.2)
        uav.arm()
        uav.end(uav.prepare.take_off(2.0).begin().future)
        uav.end(uav.prepare.go_to_waypoint(at(1.0, 2.0, 2.0)).begin().future)
        uav.end(uav.prepare.land().begin().future)
        return [samples.telemetry_from_proto(samples.telemetry_to_proto(sample)) for sample in uav.samples]
