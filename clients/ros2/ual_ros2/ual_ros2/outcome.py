"""Outcome of a command, as services and actions report it."""

from __future__ import annotations

import asyncio
import json
import logging
import math
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import ual
from ual_ros2 import naming
from ual_ros2.messages import Message

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class CommandOutcome:
    """Done, or refused or failed by a reason of UAL, with its words and metadata."""

    reason: str = ""
    message: str = ""
    metadata: Mapping[str, str] = field(default_factory=dict)
    told: Mapping[str, Message] = field(default_factory=dict)
    """Further fields of the answer, where it is done."""

    @property
    def is_success(self) -> bool:
        """Whether it is done."""
        return not self.reason

    @property
    def text(self) -> str:
        """Reason and words in one line."""
        return f"{self.reason}: {self.message}" if self.reason else ""

    @property
    def text_of_all(self) -> str:
        """All of it, for messages that have no other field: the metadata is JSON in a second line."""
        return f"{self.text}\n{json.dumps(dict(self.metadata))}" if self.metadata else self.text

    def text_of(self, command: str) -> str:
        """Returns the name of a command, and why it was refused or has failed, in one line."""
        return f"{command}: {self.reason}: {self.message.removeprefix(f'{command}: ')}"

    @classmethod
    def of(cls, error: ual.UalError, request: Message | None = None) -> CommandOutcome:
        """Makes the one of an error. The field at fault has the name that it has in the request."""
        field = error.metadata.get("field", "")
        named = naming.field_of(request, field) if field and request is not None else field
        if named == field:
            return cls(error.reason, error.message, error.metadata)
        return cls(error.reason, naming.in_text(error.message, field, named), {**error.metadata, "field": named})


class Before(NamedTuple):
    """Messages of a daemon just before a goal was sent: earlier reports, and the task that ran then, are not the
    goal's.

    Attributes:
        stamp_s: When, in UTC.
        task_id: The task; empty where none ran.
    """

    stamp_s: float = -math.inf
    task_id: str = ""

    @classmethod
    def of(cls, sample: ual.Telemetry | None) -> Before:
        """Returns what a sample says; None: nothing is known."""
        if sample is None:
            return cls()
        return cls(sample.stamp_s, "" if sample.task is None else sample.task.id)

    def later_task(self, sample: ual.Telemetry | None) -> ual.TaskInfo | None:
        """Returns the task that a sample tells of, if it has begun since then."""
        task = None if sample is None or sample.stamp_s < self.stamp_s else sample.task
        return None if task is None or task.id == self.task_id else task


class CommandRun:
    """A command under way. However it ends, its `task` returns an outcome: the caller in ROS always gets an answer.

    Attributes:
        before: What the daemon said just before the task was sent; None while it was not sent.

    """

    def __init__(self, begin: Callable[[], Awaitable[Mapping[str, Message]]], request: Message | None = None) -> None:
        self.before: Before | None = None
        self._request = request
        self._by = ""
        self._has_begun = False
        self.task: asyncio.Task[CommandOutcome] = asyncio.ensure_future(self._run(begin))

    def cancel(self, by: str) -> None:
        """Ends it, and with it the call of the daemon. One that has not begun yet never begins."""
        self._by = by
        if self._has_begun:  # asyncio would end the task without an outcome before that
            self.task.cancel()

    async def abort(self, by: str, abort: Callable[[], Awaitable[object]]) -> None:
        """Lets the daemon end it. If the daemon refuses that, it goes on."""
        self._by = by
        if not self._has_begun:
            return
        try:
            await abort()
        except ual.UalError as error:
            self._by = ""
            _log.warning("it is not cancelled: %s: %s", error.reason, error.message)

    async def _run(self, begin: Callable[[], Awaitable[Mapping[str, Message]]]) -> CommandOutcome:
        self._has_begun = True
        if self._by:
            return self._cancelled()
        try:
            return CommandOutcome(told=await begin())
        except ual.TaskAbortedError as error:
            return self._cancelled() if self._by else CommandOutcome.of(error)
        except ual.UalError as error:
            return CommandOutcome.of(error, self._request)
        except asyncio.CancelledError:
            return self._cancelled()
        except Exception as error:  # noqa: BLE001 (a mistake in the node: the caller must not wait for ever)
            _log.exception("a command failed in the node")
            return CommandOutcome("INTERNAL", f"the node failed: {error!r}")

    def _cancelled(self) -> CommandOutcome:
        return CommandOutcome("TASK_ABORTED", f"cancelled: {self._by}", {"by": self._by})


def fill(message: Message, outcome: CommandOutcome, key_value: Callable[..., Message]) -> Message:
    """Fills a response or result of ``ual_msgs``, and returns it."""
    message.success, message.reason, message.message = outcome.is_success, outcome.reason, outcome.message
    message.metadata = [key_value(key=key, value=value) for key, value in outcome.metadata.items()]
    for name, value in outcome.told.items():
        setattr(message, name, value)
    return message


def fill_trigger(message: Message, outcome: CommandOutcome) -> Message:
    """Fills a response of ``std_srvs/Trigger``, and returns it."""
    message.success, message.message = outcome.is_success, outcome.text_of_all
    return message
