"""Content of a recording (``ual record info``)."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from ual.recording.reader import Message, Recording


@dataclass(slots=True)
class TopicSummary:
    """The messages of one topic."""

    topic: str
    schema: str
    count: int = 0
    bytes_count: int = 0
    first_ns: int = 0
    last_ns: int = 0

    @property
    def rate_hz(self) -> float | None:
        """Messages per second; None for a single one."""
        duration_ns = self.last_ns - self.first_ns
        return (self.count - 1) * 1e9 / duration_ns if duration_ns > 0 else None

    def add(self, message: Message) -> None:
        """Counts a message."""
        self.first_ns = self.first_ns or message.log_ns
        self.last_ns = max(self.last_ns, message.log_ns)
        self.count += 1
        self.bytes_count += len(message.data)


@dataclass(slots=True)
class UavSummary:
    """Events of one UAV."""

    states: list[str] = field(default_factory=list)
    """Its states, in their order."""
    calls: Counter[str] = field(default_factory=Counter)
    """Ended calls, by method and outcome: ``TakeOff OK``, ``Land WRONG_STATE``."""

    def add(self, message: Message) -> None:
        """Takes note of a message about it."""
        if message.name == "states":
            self.states.append(message.json()["new"])
        elif message.name == "calls":
            call = message.json()
            if call["event"] == "ended":
                outcome = call["reason"] or call["status"]
                self.calls[f"{call['method'].rpartition('/')[2]} {outcome}"] += 1


@dataclass(slots=True)
class Summary:
    """Content of a recording; times are UTC since 1970, in seconds, and None where it has no message."""

    file: str
    is_whole: bool = False
    began_s: float | None = None
    ended_s: float | None = None
    size_bytes: int = 0
    topics: dict[str, TopicSummary] = field(default_factory=dict)
    uavs: dict[str, UavSummary] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)


def summarize(recording: Recording) -> Summary:
    """Reads all of a recording. Raises as `Recording.messages` does."""
    summary = Summary(str(recording.path))
    for message in recording.messages():
        if summary.began_s is None:
            summary.began_s = message.log_ns * 1e-9
        summary.ended_s = message.log_ns * 1e-9
        kind = message.schema or message.encoding
        summary.topics.setdefault(message.topic, TopicSummary(message.topic, kind)).add(message)
        if message.ns:
            summary.uavs.setdefault(message.ns, UavSummary()).add(message)
    summary.is_whole, summary.metadata = recording.is_whole, recording.metadata
    summary.size_bytes = recording.path.stat().st_size
    return summary
