from __future__ import annotations

import errno
import io
import json
import logging
import os
import threading
from collections.abc import Iterator

import pytest

from ual_daemon import logs
from ual_daemon.program import log_output

LOG = logging.getLogger("ual_daemon.vehicle")


class Log:
    """Logged lines, in one format."""

    def __init__(self) -> None:
        self.stream = io.StringIO()

    def begin(self, format: log_output.Format, level: str = "info") -> None:  # noqa: A002
        log_output.setup(level, format, self.stream)

    def rows(self) -> list[str]:
        for handler in logging.getLogger().handlers:
            handler.close()
        return self.stream.getvalue().splitlines()


@pytest.fixture
def log() -> Iterator[Log]:
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    root.handlers = []
    yield Log()
    for handler in root.handlers:
        handler.close()
    root.handlers = handlers
    root.setLevel(level)


def test_text_is_one_message_with_the_fields(log: Log) -> None:
    log.begin("text")
    logs.event(LOG, logging.INFO, "state", old="LANDED_ARMED", new="TAKING_OFF", why="our take-off", height_m=1 / 3)
    (line,) = log.rows()
    assert line.endswith('INFO    vehicle: state old=LANDED_ARMED new=TAKING_OFF why="our take-off" height_m=0.333333')


def test_a_value_cannot_forge_a_row_or_a_field(log: Log) -> None:
    log.begin("text")
    logs.event(LOG, logging.INFO, "refused", frame="a\n2026-01-01 ERROR x", other='b" why="c', empty="")
    (line,) = log.rows()
    assert r'frame="a\n2026-01-01 ERROR x" other="b\" why=\"c" empty=""' in line


def test_json_is_one_object_a_row(log: Log) -> None:
    log.begin("json")
    logs.event(LOG, logging.WARNING, "state", new="LANDING", distance_m=float("nan"), height_m=2.5)
    LOG.error("%d lines", 2)
    event, plain = map(json.loads, log.rows())
    assert event["time"].endswith("Z")
    assert {key: event[key] for key in event if key != "time"} == {
        "level": "warning",
        "logger": "ual_daemon.vehicle",
        "event": "state",
        "new": "LANDING",
        "distance_m": "nan",
        "height_m": 2.5,
    }
    assert plain["message"] == "2 lines"


@pytest.mark.parametrize("format_", ["text", "json"])
def test_an_exception_keeps_its_traceback(log: Log, format_: log_output.Format) -> None:
    log.begin(format_)
    try:
        int("boom")
    except ValueError:
        LOG.exception("it failed")
    text = "\n".join(log.rows())
    assert "it failed" in text
    assert "Traceback" in text
    assert "ValueError: invalid literal" in text


def test_the_caller_is_named_unless_it_is_this_process(log: Log) -> None:
    log.begin("json")
    logs.event(LOG, logging.INFO, "land")
    token = logs.caller.set(lambda: "ipv4:127.0.0.1:4711")
    try:
        logs.event(LOG, logging.INFO, "land")
    finally:
        logs.caller.reset(token)
    first, second = map(json.loads, log.rows())
    assert "caller" not in first
    assert second["caller"] == "ipv4:127.0.0.1:4711"


def test_levels_below_are_left_out(log: Log) -> None:
    log.begin("text", level="warning")
    logs.event(LOG, logging.INFO, "state")
    logs.event(LOG, logging.WARNING, "link_lost")
    (line,) = log.rows()
    assert "link_lost" in line


class _Stuck(io.StringIO):
    """A stream whose reader is stuck until it is released."""

    def __init__(self) -> None:
        super().__init__()
        self.is_writing = threading.Event()
        self.may_write = threading.Event()

    def write(self, text: str) -> int:
        self.is_writing.set()
        self.may_write.wait()
        return super().write(text)


def test_a_blocked_stream_delays_nobody_and_the_loss_is_logged() -> None:
    stream = _Stuck()
    handler = log_output.BackgroundHandler(stream, queue_size=3)
    handler.setFormatter(logging.Formatter())

    def emit(text: str) -> None:
        handler.emit(logging.LogRecord("x", logging.INFO, __file__, 1, text, None, None))

    emit("first")
    assert stream.is_writing.wait(10)
    for number in range(5):  # 3 fit the queue, 2 are lost
        emit(f"line {number}")
    stream.may_write.set()
    handler.close()
    assert stream.getvalue().splitlines() == [
        "first",
        "line 0",
        "line 1",
        "line 2",
        "2 log lines lost: the log is not read fast enough",
    ]


class _Buffered(_Stuck):
    """A stream that keeps what is written until it is flushed, as a pipe's does."""

    flushed = ""

    def flush(self) -> None:
        self.flushed = self.getvalue()


def test_the_last_row_leaves_the_buffer_also_where_the_end_came_with_it() -> None:
    stream = _Buffered()
    handler = log_output.BackgroundHandler(stream)
    handler.emit(logging.LogRecord("x", logging.INFO, __file__, 1, "last", None, None))
    assert stream.is_writing.wait(10)
    handler._lines.put(None)  # the end, while the last line is being written
    stream.may_write.set()
    handler._thread.join(10)
    assert stream.flushed == "last\n"


class _Failing(io.StringIO):
    """A stream that cannot be written to as long as it has an error."""

    def __init__(self, error: int) -> None:
        super().__init__()
        self.error = error
        self.has_failed = threading.Event()
        self.has_written = threading.Event()

    def write(self, text: str) -> int:
        if self.error:
            self.has_failed.set()
            raise OSError(self.error, os.strerror(self.error))
        written = super().write(text)
        self.has_written.set()
        return written


@pytest.mark.parametrize("error", [errno.ENOSPC, errno.EAGAIN, errno.EIO])
def test_the_log_goes_on_after_it_could_not_be_written_for_a_while(log: Log, error: int) -> None:
    log.stream = stream = _Failing(error)
    log.begin("text")
    logs.event(LOG, logging.INFO, "while_full")
    assert stream.has_failed.wait(10)
    stream.error = 0
    logs.event(LOG, logging.INFO, "after")
    assert stream.has_written.wait(10)
    loss, line = log.rows()
    assert loss == f"up to 1 log lines lost: {os.strerror(error)}"
    assert "after" in line


@pytest.mark.parametrize("error", [errno.EPIPE, errno.EBADF])
def test_the_log_ends_when_nobody_can_read_it(error: int) -> None:
    handler = log_output.BackgroundHandler(_Failing(error))
    handler.emit(logging.LogRecord("x", logging.INFO, __file__, 1, "unheard", None, None))
    handler._thread.join(10)
    assert not handler._thread.is_alive()
    handler.close()


# --- Bounded ----------------------------------------------------------------------------------------------------------


def refuse(why: str, times: int) -> None:
    for port in range(times):
        token = logs.caller.set(lambda port=port: f"ipv4:127.0.0.1:{port}")  # type: ignore[misc]
        logs.event(LOG, logging.WARNING, "refused", command="land", why=why)
        logs.caller.reset(token)


def test_refusals_that_are_repeated_are_counted(log: Log) -> None:
    log.begin("json")
    refuse("not flying", 58)
    refuse("no link", 1)
    first, other, repeated = map(json.loads, log.rows())
    assert (first["caller"], other["why"]) == ("ipv4:127.0.0.1:0", "no link")
    assert (repeated["event"], repeated["why"], repeated["repeated"]) == ("refused", "not flying", 57)
    assert "caller" not in repeated


def test_warnings_without_fields_are_counted_and_commands_are_not(log: Log) -> None:
    log.begin("text")
    for _ in range(3):
        LOG.error("an update failed")
        logs.event(LOG, logging.INFO, "command", command="go_to_waypoint")
    lines = log.rows()
    assert [line.partition("vehicle: ")[2] for line in lines] == [
        "an update failed",
        *["command command=go_to_waypoint"] * 3,
        "repeated 2 times: an update failed",
    ]


def test_warnings_with_fields_are_counted_and_states_are_not(log: Log) -> None:
    """A text that an autopilot repeats ten times a second filled the log."""
    log.begin("json")
    for _ in range(3):
        logs.event(LOG, logging.ERROR, "autopilot_says", text="Potential Thrust Loss", severity=0)
        logs.event(LOG, logging.WARNING, "state", old="FLYING_AUTO", new="UNINITIALIZED", why="no data")
    found = [(row["event"], row.get("repeated")) for row in map(json.loads, log.rows())]
    assert found == [("autopilot_says", None), *[("state", None)] * 3, ("autopilot_says", 2)]


def test_the_number_is_written_when_the_period_is_over() -> None:
    now_s = [0.0]
    handler = log_output.BackgroundHandler(stream := io.StringIO(), clock=lambda: now_s[0])
    for time_s in (0.0, 1.0, 9.0, 11.0, 12.0):
        now_s[0] = time_s
        handler.handle(logging.LogRecord("x", logging.WARNING, __file__, 1, "again", None, None))
    handler.close()
    assert stream.getvalue().splitlines() == ["again", "repeated 2 times: again", "again", "repeated 1 times: again"]


@pytest.mark.parametrize("format_", ["text", "json"])
def test_what_is_logged_is_bounded(log: Log, format_: log_output.Format) -> None:
    log.begin(format_)
    logs.event(LOG, logging.INFO, "command", frame="f" * 100_000)
    LOG.warning("w" * 100_000)
    field, message = log.rows()
    assert len(field) < 600
    assert "... (100000 characters)" in field
    assert len(message) < 2300


def test_a_row_that_the_stream_cannot_encode_does_not_end_the_log() -> None:
    written = io.BytesIO()
    stream = io.TextIOWrapper(written, encoding="utf-8", errors="strict")  # as a worker's pipe
    handler = log_output.BackgroundHandler(stream)
    for text in ("before", "a file \udcff of ü", "after"):
        handler.handle(LOG.makeRecord(LOG.name, logging.INFO, "", 0, text, (), None))
    handler.close()
    assert written.getvalue().decode().splitlines() == ["before", r"a file \udcff of \xfc", "after"]
