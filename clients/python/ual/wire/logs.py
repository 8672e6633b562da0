"""Between the messages of ``logs.proto`` and their values. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from ual.logs.values import Log, LogChunk
from ual.v1 import logs_pb2 as pb
from ual.wire import convert


def log_to_proto(value: Log) -> pb.Log:
    """Makes a message."""
    return pb.Log(
        log_id=value.id,
        size_bytes=value.size_bytes,
        written=None if value.time_s is None else convert.timestamp_to_proto(value.time_s),
        is_missing=value.is_missing,
    )


def log_from_proto(message: pb.Log) -> Log:
    """Reads a message."""
    return Log(
        message.log_id,
        message.size_bytes,
        convert.stamp_from_proto(message.written) if message.HasField("written") else None,
        message.is_missing,
    )


def log_chunk_to_proto(value: LogChunk) -> pb.DownloadLogResponse:
    """Makes a message."""
    return pb.DownloadLogResponse(
        log=log_to_proto(value.log),
        offset=value.offset,
        data=value.data,
        sha256=value.sha256,
    )


def log_chunk_from_proto(message: pb.DownloadLogResponse) -> LogChunk:
    """Reads a message."""
    return LogChunk(
        log_from_proto(message.log),
        message.offset,
        message.data,
        message.sha256,
    )
