"""Recorded flights (tests/data, see its README): their frames and events."""

import gzip
import json
import socket
import struct
import time
from dataclasses import dataclass
from pathlib import Path

from ual_daemon.backends.mavlink.wire.frames import split

DATA = Path(__file__).parents[3] / "data"


@dataclass(frozen=True)
class Event:
    name: str
    time_s: float
    """From the beginning of the recording."""


@dataclass(frozen=True)
class Trace:
    frames: list[tuple[float, bytes]]
    """Time from the beginning of the recording, and the raw frame."""
    events: list[Event]

    def time_s(self, name: str, nth: int = 0) -> float:
        """When an event came for the nth time."""
        return [event.time_s for event in self.events if event.name == name][nth]


def load(name: str) -> Trace:
    """The flight of a name."""
    data = gzip.decompress((DATA / f"{name}.tlog.gz").read_bytes())
    frames: list[tuple[float, bytes]] = []
    at = 0
    while at < len(data):
        (microseconds,) = struct.unpack_from(">Q", data, at)
        (frame, *_), _ = split(data[at + 8 : at + 8 + 300])
        frames.append((microseconds / 1e6, frame.data))
        at += 8 + len(frame.data)
    begin_s = frames[0][0]
    events = json.loads((DATA / f"{name}.json").read_text())["events"]
    return Trace(
        [(time_s - begin_s, frame) for time_s, frame in frames],
        [Event(event["event"], event["t_unix_s"] - begin_s) for event in events],
    )


def replay(trace: Trace, port: int, *, speed_factor: float, until_s: float = float("inf")) -> None:
    """Sends a flight to a UDP port of this computer, as the autopilot did."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        begin_s = time.monotonic()
        for time_s, frame in trace.frames:
            if time_s > until_s:
                return
            wait_s = begin_s + time_s / speed_factor - time.monotonic()
            if wait_s > 0.001:  # shorter ones are not worth a system call; those to come make up for them
                time.sleep(wait_s)
            sender.sendto(frame, ("127.0.0.1", port))
