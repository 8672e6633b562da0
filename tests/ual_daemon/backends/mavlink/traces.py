"""Recorded flights (tests/data, see its README): their frames and events."""

import gzip
import json
import socket
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tests.waiting import until
from ual_daemon.backends.mavlink.wire.frames import split

DATA = Path(__file__).parents[3] / "data"
_SHORTEST_S = 0.002
"""Shorter pauses are not worth a system call: they are made together."""


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
        """Returns the time at which an event came for the nth time."""
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


def replay(trace: Trace, port: int, *, speed_factor: float) -> None:
    """Sends a flight to a UDP port of this computer, as the autopilot did, only faster."""

    def let_pass(passed_s: float) -> bool:
        time.sleep(passed_s / speed_factor)  # as it was recorded
        return True

    replay_stepped(trace, port, let_pass, speed_factor * _SHORTEST_S)


def _pause() -> None:
    time.sleep(_SHORTEST_S)  # shorter than that of `until`: a receiver reads at once


def replay_stepped(trace: Trace, port: int, let_pass: Callable[[float], bool], step_s: float = 0.02) -> None:
    """Sends a flight to a UDP port of this computer until `let_pass`, which has the time between pass, returns False.

    It goes on once all was read: neither a receiver nor this thread that is not scheduled makes it come in a burst.
    """
    passed_s, last_s = 0.0, trace.frames[0][0]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for time_s, frame in trace.frames:
            passed_s, last_s = passed_s + time_s - last_s, time_s
            if passed_s > step_s:
                until(lambda: not _unread_bytes(port), "the receiver", between=_pause)
                if not let_pass(passed_s):
                    return
                passed_s = 0.0
            sender.sendto(frame, ("127.0.0.1", port))


def _unread_bytes(port: int) -> int:
    """Returns the bytes that wait in the UDP socket of a port, with all that they cost."""
    sockets = [line.split() for line in Path("/proc/net/udp").read_text().splitlines()[1:]]
    return sum(int(fields[4].split(":")[1], 16) for fields in sockets if int(fields[1].split(":")[1], 16) == port)
