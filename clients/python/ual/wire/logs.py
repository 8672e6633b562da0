"""Between the messages of `LogService` and the value types."""

from __future__ import annotations

from ual.logs.values import Log, LogChunk
from ual.v1 import logs_pb2 as pb


def to_proto(log: Log) -> pb.Log:
    """Makes a message."""
    message = pb.Log(log_id=log.id, size_bytes=log.size_bytes, is_missing=log.is_missing)
    if log.time_s is not None:
        message.written.FromMilliseconds(round(log.time_s * 1e3))
    return message


def from_proto(message: pb.Log) -> Log:
    """Reads a message."""
    time_s = message.written.ToMilliseconds() / 1e3 if message.HasField("written") else None
    return Log(message.log_id, message.size_bytes, time_s, message.is_missing)


def chunk_to_proto(chunk: LogChunk) -> pb.DownloadLogResponse:
    """Makes a response of a download."""
    return pb.DownloadLogResponse(log=to_proto(chunk.log), offset=chunk.offset, data=chunk.data, sha256=chunk.sha256)


def chunk_from_proto(message: pb.DownloadLogResponse) -> LogChunk:
    """Reads a response of a download."""
    return LogChunk(from_proto(message.log), message.offset, message.data, message.sha256)
