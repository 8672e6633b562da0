"""The lines of a log in a recording."""

from __future__ import annotations

import logging
from collections.abc import Callable

from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.timestamp_pb2 import Timestamp
from typing_extensions import override

from ual.recording.recorder import Entry, Output, Recorder
from ual.recording.topics import of_protobuf

_TOPIC = "/log"
_LEVELS = (
    (logging.CRITICAL, Log.FATAL),
    (logging.ERROR, Log.ERROR),
    (logging.WARNING, Log.WARNING),
    (logging.INFO, Log.INFO),
    (logging.NOTSET, Log.DEBUG),
)
LONGEST_MESSAGE_CHARACTERS = 4000
"""In characters. Callers give names and values: they must not fill the recording."""


class RecordingHandler(logging.Handler):
    """Records each line of the log. `text` makes the line of a record, on the thread that logs."""

    def __init__(self, recorder: Recorder, text: Callable[[logging.LogRecord], str]) -> None:
        super().__init__()
        self._recorder = recorder
        self._text = text
        self._topic = of_protobuf(_TOPIC, Log)

    @override
    def emit(self, record: logging.LogRecord) -> None:
        line = self._text(record)[:LONGEST_MESSAGE_CHARACTERS]
        self._recorder.put(self._write, self._recorder.clock.now_ns(), (record, line), len(line))

    def _write(self, output: Output, entry: Entry) -> None:
        record, line = entry.value
        ns = entry.log_ns
        message = Log(
            timestamp=Timestamp(seconds=ns // 1_000_000_000, nanos=ns % 1_000_000_000),
            level=next(level for least, level in _LEVELS if record.levelno >= least),
            message=line,
            name=record.name,
            file=record.filename,
            line=record.lineno,
        )
        output.write(self._topic, message.SerializeToString(), ns, round(record.created * 1e9))
