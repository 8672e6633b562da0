"""Reads recordings, those too that end in the middle: of a daemon that was killed, or that still records."""

from __future__ import annotations

import heapq
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ual.errors import InvalidArgumentError
from ual.recording import requirements
from ual.types import Frame, Telemetry
from ual.v1 import ual_pb2 as pb
from ual.wire import samples, uav

if TYPE_CHECKING:
    from mcap.records import Channel, Schema

_SORT_WINDOW_NS = 1_000_000_000
"""Messages of several threads are out of order by less than this."""


class Message(NamedTuple):
    """One message of a recording; times are UTC since 1970 in nanoseconds (see `ual.recording.topics`)."""

    log_ns: int
    """Time of the record."""
    publish_ns: int
    """Time for which the content is valid."""
    topic: str
    encoding: str
    schema: str
    metadata: Mapping[str, str]
    data: bytes

    @property
    def ns(self) -> str:
        """The UAV that it is about; empty for the log."""
        return self.topic.split("/")[1] if self.topic.count("/") > 1 else ""

    @property
    def name(self) -> str:
        """The topic without the UAV: ``telemetry``, ``raw/received``."""
        return self.topic.removeprefix(f"/{self.ns}/")

    def json(self) -> dict[str, Any]:
        """Returns the object of a message in JSON."""
        found: dict[str, Any] = json.loads(self.data)
        return found

    def telemetry(self) -> Telemetry:
        """Returns the sample of a message of the topic ``telemetry``."""
        return samples.telemetry_from_proto(pb.Telemetry.FromString(self.data))

    def frames(self) -> list[Frame]:
        """Returns the frames of a message of the topic ``frames``."""
        return [uav.frame_from_proto(frame) for frame in pb.ListFramesResponse.FromString(self.data).frames]


@dataclass(slots=True)
class Recording:
    """A file. What it says of itself is known once its messages have been read."""

    path: Path
    is_whole: bool = False
    """Whether it has its end: else the program that recorded was killed, or still records."""
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)

    def messages(self, is_wanted: Callable[[str], bool] = lambda _: True) -> Iterator[Message]:
        """Yields the messages of the topics that are wanted, by the time at which they were recorded.

        Raises:
            InvalidArgumentError: It cannot be read, or is no recording.
            NotSupportedError: The extra is not installed.

        """
        waiting: list[tuple[int, int, Message]] = []
        for count, message in enumerate(self._in_order_of_file(is_wanted)):
            heapq.heappush(waiting, (message.log_ns, count, message))
            while message.log_ns - waiting[0][0] > _SORT_WINDOW_NS:
                yield heapq.heappop(waiting)[2]
        while waiting:
            yield heapq.heappop(waiting)[2]

    def uavs(self) -> list[str]:
        """Returns the namespaces of the UAVs whose telemetry it has. Raises as `messages` does."""
        is_wanted = "/telemetry"
        return sorted({message.ns for message in self.messages(lambda topic: topic.endswith(is_wanted))})

    def _in_order_of_file(self, is_wanted: Callable[[str], bool]) -> Iterator[Message]:
        requirements.require_reading()
        from mcap.records import Channel, Footer, Metadata, Schema
        from mcap.records import Message as Record

        channels: dict[int, tuple[Channel, str] | None] = {}
        schemas: dict[int, Schema] = {}
        for record in self._records():
            if isinstance(record, Record):
                found = channels.get(record.channel_id)
                if found is not None:
                    channel, schema = found
                    yield _message(channel, schema, record)
            elif isinstance(record, Channel):
                known = schemas.get(record.schema_id)
                name = "" if known is None else known.name
                channels[record.id] = (record, name) if is_wanted(record.topic) else None
            elif isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Metadata):
                self.metadata[record.name] = record.metadata
            elif isinstance(record, Footer):
                self.is_whole = True

    def _records(self) -> Iterator[object]:
        from mcap.stream_reader import StreamReader

        try:
            with self.path.open("rb") as file:
                if file.read(len(_MAGIC)) != _MAGIC:
                    raise _unreadable(self.path, "it is no MCAP file" if file.tell() else "it is empty")
                file.seek(0)
                records = iter(StreamReader(file).records)
                while True:
                    try:
                        record = next(records)
                    except StopIteration:
                        return
                    except OSError:
                        raise
                    except Exception:  # noqa: BLE001  it ends in the middle of a record, or is damaged: what was read counts
                        return
                    yield record
        except OSError as error:
            raise _unreadable(self.path, error.strerror or str(error)) from None


_MAGIC = b"\x89MCAP0\r\n"
"""First bytes of each MCAP file. It is written before anything else, and a killed daemon leaves it, too."""


def _unreadable(path: Path, why: str) -> InvalidArgumentError:
    return InvalidArgumentError(f"cannot read {path}: {why}", {"field": "file"})


def _message(channel: Channel, schema: str, record: Any) -> Message:  # noqa: ANN401  a record of the library
    return Message(
        record.log_time,
        record.publish_time,
        channel.topic,
        channel.message_encoding,
        schema,
        channel.metadata,
        record.data,
    )
