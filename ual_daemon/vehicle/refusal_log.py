"""Logs which commands were refused, and which were accepted."""

from __future__ import annotations

import logging
import time
from contextlib import AbstractContextManager
from types import TracebackType

from ual.errors import UalError
from ual.shared.ages import without_seconds
from ual_daemon import logs

_log = logging.getLogger(__name__)

_REPEATED_REFUSAL_S = 1.0


class _LoggingRefusal(AbstractContextManager[None]):
    """A class, because `contextlib.contextmanager` costs two to three times as much."""

    __slots__ = ("_command", "_refusals")

    def __init__(self, refusals: RefusalLog, command: str) -> None:
        self._refusals = refusals
        self._command = command

    def __enter__(self) -> None:
        return None

    def __exit__(self, _: type[BaseException] | None, error: BaseException | None, __: TracebackType | None) -> None:
        if isinstance(error, UalError):
            self._refusals.log_refusal(self._command, error)


class RefusalLog:
    """The refusals of one UAV. Any thread may call."""

    def __init__(self) -> None:
        self._last_refusal = ("", 0.0)
        self._left_out_count = 0

    def logging_refusal(self, command: str) -> AbstractContextManager[None]:
        """Logs the refusal that is raised in its block.

        Of a refusal that is repeated (a stream of setpoints), only one a second is logged, with the number of those
        that were not.
        """
        return _LoggingRefusal(self, command)

    def log_refusal(self, command: str, error: UalError) -> None:
        """See `logging_refusal`."""
        text, now_s = f"{command}: {without_seconds(str(error))}", time.monotonic()
        last_text, last_s = self._last_refusal
        if text == last_text and now_s - last_s <= _REPEATED_REFUSAL_S:
            self._left_out_count += 1
            return
        left_out_count = self._left_out_count if text == last_text else 0
        self._last_refusal, self._left_out_count = (text, now_s), 0
        logs.refused(_log, command, error, left_out_count)


def accepted(command: str, **fields: object) -> None:
    """Logs that a command was accepted."""
    logs.event(_log, logging.INFO, "command", command=command, **fields)
