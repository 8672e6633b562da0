"""One MCAP file that is being written."""

from __future__ import annotations

import errno
import io
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from ual.recording.topics import Schema, Topic
from ual.shared import output_file, whole_file

_CANNOT_SYNC = (errno.EINVAL, errno.ENOTSUP)
"""Some file systems cannot say when something is on the disk."""
_sync_data = getattr(os, "fdatasync", os.fsync)
"""macOS and Windows only have the one that also waits for the times of the file."""
_CHUNK_BYTES = 1 << 20
"""A chunk ends at this size, and at each `File.flush`."""


class File:
    """An MCAP file, chunked and indexed. What was written before the last `flush` outlives a killed process, and a
    computer without power.

    Raises:
        OSError: From each method: the file cannot be written.

    """

    def __init__(self, path: Path, metadata: Mapping[str, Mapping[str, str]]) -> None:
        self.path = path
        self._whole_bytes = self._first_bytes = 0
        # The positions of UAVs are not for all users of the computer.
        self._raw = io.FileIO(path, "xb", opener=lambda name, flags: os.open(name, flags, whole_file.OWNER_PERMISSIONS))
        self._stream = io.BufferedWriter(self._raw)
        try:
            self._begin(metadata)
        except BaseException:
            self.give_up()
            raise

    def _begin(self, metadata: Mapping[str, Mapping[str, str]]) -> None:
        from mcap.writer import CompressionType, Writer

        self._writer: Any = Writer(self._stream, _CHUNK_BYTES, CompressionType.LZ4)  # it has types in part only
        self._channels: dict[Topic, int] = {}
        self._schemas: dict[str, int] = {}
        self._writer.start(profile="", library="ual")
        for name, values in metadata.items():
            self._writer.add_metadata(name, dict(values))
        self.flush()
        self._first_bytes = self._whole_bytes

    def fileno(self) -> int:
        """Returns the descriptor of the open file."""
        return self._raw.fileno()

    @property
    def size_bytes(self) -> int:
        """The size of the file at the last `flush`."""
        return self._whole_bytes

    def write(self, topic: Topic, data: bytes, log_ns: int, publish_ns: int, sequence: int = 0) -> None:
        """Adds a message; `log_ns` and `publish_ns` are UTC since 1970, in nanoseconds."""
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._channels[topic] = self._register(topic)
        self._writer.add_message(channel, log_ns, data, publish_ns, sequence & 0xFFFFFFFF)

    def flush(self) -> None:
        """Ends the chunk, and waits until all of it is on the disk."""
        self._writer.flush()
        _sync(self._raw.fileno())
        self._whole_bytes = self._stream.tell()

    def finish(self) -> None:
        """Writes the index, and closes the file."""
        self._writer.finish()
        self._stream.flush()
        _sync(self._raw.fileno())
        self._stream.close()

    def give_up(self) -> None:
        """Closes the file without an index. It ends with the last whole chunk; one with none is removed."""
        if self._whole_bytes == self._first_bytes and not output_file.loss_of(self.path, self._raw.fileno()):
            with suppress(OSError):
                self.path.unlink()
        with suppress(OSError, ValueError):
            os.ftruncate(self._raw.fileno(), self._whole_bytes)
        with suppress(OSError, ValueError):
            self._raw.close()
        with suppress(OSError, ValueError):
            self._stream.close()

    def _register(self, topic: Topic) -> int:
        schema_id = 0 if topic.schema is None else self._schema_id(topic.schema)
        return int(self._writer.register_channel(topic.name, topic.encoding, schema_id, dict(topic.metadata)))

    def _schema_id(self, schema: Schema) -> int:
        known = self._schemas.get(schema.name)
        if known is None:
            known = self._writer.register_schema(schema.name, schema.encoding, schema.data)
            self._schemas[schema.name] = known
        return known


def _sync(descriptor: int) -> None:
    """Waits until what was written is on the disk, where the file system can say so."""
    try:
        _sync_data(descriptor)
    except OSError as error:
        if error.errno not in _CANNOT_SYNC:
            raise
