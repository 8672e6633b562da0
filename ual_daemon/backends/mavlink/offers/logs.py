"""The logs of a MAVLink autopilot: by MAVFTP where it has that, else by LOG_REQUEST_LIST and LOG_REQUEST_DATA."""

from __future__ import annotations

import calendar
import logging
import re
import time
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import TypeVar

from typing_extensions import override

from ual.errors import InvalidArgumentError, NotSupportedError, UalError
from ual.logs.values import Log
from ual_daemon.backends import futures
from ual_daemon.backends.mavlink.offers.files import has_files
from ual_daemon.backends.mavlink.offers.protocol_access import ProtocolAccess
from ual_daemon.backends.mavlink.protocols.ftp import DirectoryEntry, Ftp, Steps
from ual_daemon.backends.mavlink.protocols.ftp_packet import FtpNakError, Nak
from ual_daemon.backends.mavlink.protocols.log_transfers import LogEntry
from ual_daemon.backends.mavlink.protocols.protocols import Protocols
from ual_daemon.backends.offers.logs import AutopilotLogs

T = TypeVar("T")

_logger = logging.getLogger(__name__)

DIRECTORIES = ("/fs/microsd/log", "/APM/LOGS", "log", "logs")
"""Directories of logs: PX4, ArduPilot, and the simulations of both."""
_NEWEST = "LASTLOG.TXT"
"""ArduPilot's file with the number of its newest log: after its largest number it begins again with 1."""
_ENDINGS = (".ulg", ".ulge", ".bin", ".px4log")
_NO_DIRECTORY = {Nak.FILE_NOT_FOUND, Nak.FAIL, Nak.FAIL_ERRNO}
_PX4_NAME = re.compile(r"(\d{4}-\d\d-\d\d)/(\d\d_\d\d_\d\d)\b.*")
_ARDUPILOT_NAME = re.compile(r"(\d{1,9})\.BIN", re.IGNORECASE)


class MavlinkLogs(AutopilotLogs):
    """The logs of one backend.

    Args:
        reach: The way to the thread that receives.

    """

    def __init__(self, access: ProtocolAccess) -> None:
        self._access = access
        self._paths: dict[str, str] = {}
        """Of the last list by MAVFTP: the path of each log."""

    @override
    def read_all(self) -> Future[list[Log]]:
        return self._run_on_loop(self._list_files, self._list_numbers)

    @override
    def read(self, log_id: str, offset: int, size: int) -> Future[bytes]:
        return self._run_on_loop(
            lambda files: files.read(self._path(log_id), offset, size),
            lambda protocols, future: protocols.logs.read(_number(log_id), offset, size, future),
        )

    def _run_on_loop(
        self, by_files: Callable[[Ftp], Steps[T]], by_numbers: Callable[[Protocols, Future[T]], None]
    ) -> Future[T]:
        what = "read its logs"
        session = self._access.session_in_reach(what)
        if isinstance(session, UalError):
            return futures.failed(session)

        def begin(protocols: Protocols, future: Future[T]) -> None:
            if has_files(session):
                protocols.files.run(future, by_files(protocols.files))
            else:
                by_numbers(protocols, future)

        return self._access.run_on_loop(what, begin)

    def _path(self, log_id: str) -> str:
        if log_id not in self._paths:
            raise unknown(log_id)
        return self._paths[log_id]

    def _list_files(self, files: Ftp) -> Steps[list[Log]]:
        """Lists the logs in the first directory that there is. The steps end on the thread that receives.

        A log that is open is closed first: PX4 reads it no further than it went when it was opened.
        """
        yield from files.closed()
        for directory in DIRECTORIES:
            try:
                found = yield from files.list_directory(directory)
            except FtpNakError as error:
                if error.code not in _NO_DIRECTORY:
                    raise
                continue
            logs = yield from self._logs_in(files, directory, found)
            self._paths = {each.id: f"{directory}/{each.id}" for each in logs}
            return logs
        self._paths = {}
        return []

    def _logs_in(self, files: Ftp, directory: str, entries: list[DirectoryEntry]) -> Steps[list[Log]]:
        logs = [_log(each.name, each.size) for each in entries if each.size is not None and _is_log(each.name)]
        for each in sorted(entries):
            if each.size is None:
                logs += yield from self._logs_below(files, directory, each.name)
        newest = 0
        if any(each.name == _NEWEST for each in entries):
            try:
                text = yield from files.read_all(f"{directory}/{_NEWEST}", 64)
            except FtpNakError as error:  # the logs are there all the same
                _logger.warning("the order of the logs is not known: %s is not read: %s", _NEWEST, error.message)
                text = b""
            newest = int(text) if text.strip().isdigit() else 0
        return sorted(logs, key=partial(_age, newest))

    def _logs_below(self, files: Ftp, directory: str, name: str) -> Steps[list[Log]]:
        """Lists the logs of one day. Those of a directory that the autopilot does not list are missing, as a whole."""
        try:
            inside = yield from files.list_directory(f"{directory}/{name}")
        except (FtpNakError, NotSupportedError) as error:
            _logger.warning("the autopilot does not list its logs of %s: %s", name, error.message)
            return [Log(f"{name}/", 0, is_missing=True)]
        return [
            _log(f"{name}/{file.name}", file.size) for file in inside if file.size is not None and _is_log(file.name)
        ]

    def _list_numbers(self, protocols: Protocols, future: Future[list[Log]]) -> None:
        entries: Future[list[LogEntry]] = Future()

        def on_entries(ended: Future[list[LogEntry]]) -> None:
            error = ended.exception()
            if error is not None:
                futures.fail(future, error)
            elif future.set_running_or_notify_cancel():
                ordered = sorted(ended.result(), key=lambda each: (each.size is None, each.time_utc_s, each.id))
                future.set_result([_numbered(each) for each in ordered])

        entries.add_done_callback(on_entries)
        protocols.logs.list(entries)


def unknown(log_id: str) -> InvalidArgumentError:
    """Returns that there is no such log."""
    return InvalidArgumentError(f"log_id: the autopilot has no log {log_id:.80}; list them", {"field": "log_id"})


def _numbered(entry: LogEntry) -> Log:
    size = entry.size
    return Log(str(entry.id), size or 0, float(entry.time_utc_s) or None, is_missing=size is None)


def _number(log_id: str) -> int:
    if not (log_id.isdecimal() and log_id.isascii() and int(log_id) <= 0xFFFF):
        raise unknown(log_id)
    return int(log_id)


def _is_log(name: str) -> bool:
    return name.lower().endswith(_ENDINGS)


def _log(name: str, size: int) -> Log:
    return Log(name, size, _time_s(name))


def _time_s(name: str) -> float | None:
    """Returns the time that PX4 has put into the name of a log, in UTC."""
    match = _PX4_NAME.fullmatch(name)
    if match is None:
        return None
    try:
        return float(calendar.timegm(time.strptime(f"{match[1]} {match[2]}", "%Y-%m-%d %H_%M_%S")))
    except ValueError:
        return None


def _age(newest: int, log: Log) -> tuple[bool, float, int, int, str]:
    """Returns what sorts logs, the oldest first. Those of PX4 without a time come first."""
    match = _ARDUPILOT_NAME.fullmatch(log.id)
    number = 0 if match is None else int(match[1])
    return (log.is_missing, log.time_s or 0.0, number <= newest, number, log.id)
