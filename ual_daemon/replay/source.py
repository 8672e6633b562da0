"""Reads what is played of a recording of one UAV, in the order of the times: packets, setpoints, samples, frames."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ual.errors import UalError
from ual.geometry import Vector3
from ual.recording.reader import Message, Recording
from ual.types import Frame, Telemetry
from ual_daemon.backends.values import Packet
from ual_daemon.settings import ConfigError

_FRAMES = "frames"
_PACKETS = "raw/received"
_SAMPLES = "telemetry"
_SETPOINTS = "setpoints"
_SEARCHED_TIME_NS = 10_000_000_000
"""Nanoseconds at a recording's begin that show which data it has."""


@dataclass(frozen=True, slots=True)
class SentSetpoint:
    """A setpoint that was sent, with its position; None: a velocity."""

    time_s: float
    position: Vector3 | None


@dataclass(frozen=True, slots=True)
class RecordedSample:
    """A sample of the telemetry, and when it was recorded."""

    time_s: float
    telemetry: Telemetry


@dataclass(frozen=True, slots=True)
class RecordedFrames:
    """All frames but the body, and when they were recorded."""

    time_s: float
    frames: list[Frame]


Event = Packet | SentSetpoint | RecordedSample | RecordedFrames
"""Something that is played, at its `time_s`: seconds since the beginning of the recording."""


@dataclass(frozen=True, slots=True)
class Contents:
    """Data that a recording has of a UAV."""

    uav: str
    begin_ns: int
    has_samples: bool
    encoding: str
    """Encoding of its raw packets; empty: it has none."""


def contents_of(path: Path, ns: str, uav: str | None) -> Contents:
    """Looks into a recording for a UAV.

    Raises:
        ConfigError: It cannot be read, or it is not known which of its UAVs is meant.

    """
    try:
        messages = list(_beginning(path))
    except UalError as error:
        raise ConfigError(error.message, "url") from None
    uavs = sorted({message.ns for message in messages if message.name in (_PACKETS, _SAMPLES)})
    chosen = uav or (ns if ns in uavs or len(uavs) != 1 else uavs[0])
    if chosen not in uavs:
        raise ConfigError(f"{path} has no {chosen}, but {', '.join(uavs) or 'no UAV'}", "replay.uav" if uav else "url")
    own = [message for message in messages if message.ns == chosen]
    encoding = next((message.encoding for message in own if message.name == _PACKETS), "")
    has_samples = any(message.name == _SAMPLES for message in own)
    return Contents(chosen, messages[0].log_ns, has_samples, encoding)


def _beginning(path: Path) -> Iterator[Message]:
    first_ns: int | None = None
    for message in Recording(path).messages():
        first_ns = message.log_ns if first_ns is None else first_ns
        if message.log_ns - first_ns > _SEARCHED_TIME_NS:
            return
        yield message


def events(path: Path, contents: Contents) -> Iterator[Event]:
    """Yields what is played of a recording. Raises as `Recording.messages` does."""
    wanted = {f"/{contents.uav}/{name}" for name in (_PACKETS, _SAMPLES, _SETPOINTS, _FRAMES)}
    for message in Recording(path).messages(wanted.__contains__):
        time_s = (message.log_ns - contents.begin_ns) * 1e-9
        if message.name == _SAMPLES:
            yield RecordedSample(time_s, message.telemetry())
        elif message.name == _FRAMES:
            yield RecordedFrames(time_s, message.frames())
        elif message.name == _SETPOINTS:
            json_position = json.loads(message.data).get("position")
            yield SentSetpoint(time_s, None if json_position is None else Vector3(**json_position))
        else:
            peer = message.metadata.get("peer", "")
            yield Packet(message.encoding, message.data, False, peer, time_s, message.publish_ns * 1e-9)
