"""Whether a daemon can be asked now, and what a cancel has come to. It needs no ROS.

A connection that stalls keeps what is sent, and delivers it seconds later. So what moves a UAV is not sent into one.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Generic, TypeVar

import ual
from ual.shared.waiting import ends_within
from ual_ros2.outcome import CommandOutcome

T = TypeVar("T")

QUIET_S = 0.2
"""Seconds without a sample after which a daemon is asked before a command."""
CONFIRM_S = 5.0
"""Seconds for which a cancelled goal waits until the daemon says that it has ended."""
AGAIN_S = 0.05


class DaemonContact(Generic[T]):
    """The contact to one daemon. Only the event loop calls it.

    Args:
        ask: Asks for what a daemon can answer at once.
        rate_hz: How often it sends samples.
        clock: One that goes on while the computer sleeps.

    """

    def __init__(self, ask: Callable[[], Awaitable[T]], rate_hz: float, clock: Callable[[], float]) -> None:
        self._ask = ask
        self._gap_s = 3.0 / rate_hz
        self._clock = clock
        self._heard_s = clock()

    def note(self) -> None:
        """Takes that the daemon was heard."""
        self._heard_s = self._clock()

    @property
    def silent_s(self) -> float:
        """Seconds without a message."""
        return self._clock() - self._heard_s

    async def require(self, limit_s: float, quiet_s: float = QUIET_S) -> None:
        """Requires that the daemon is heard, or answers within a time.

        Args:
            limit_s: The time.
            quiet_s: After so long without a sample (or three of them) it is asked.

        Raises:
            DaemonUnreachableError: It does not answer.
            UalError: It refuses to.

        """
        if self.silent_s > max(quiet_s, self._gap_s):
            await self.answer_within(limit_s)

    async def answer_within(self, limit_s: float) -> T:
        """Returns what the daemon answers within a time.

        Raises:
            DaemonUnreachableError: It does not answer.
            UalError: It refuses to.

        """
        asking = asyncio.ensure_future(self._ask())
        if await ends_within(asking, limit_s):
            return asking.result()
        raise ual.DaemonUnreachableError(
            f"the daemon does not answer within {limit_s:g} s: this is not sent, as it might be flown much later. "
            "Send it again when `state` tells of the UAV",
            {"limit_s": f"{limit_s:g}"},
        )


async def confirmed(
    ended: CommandOutcome,
    running_id: Callable[[], Awaitable[str]],
    own_id: str,
    known_id: str,
    limit_s: float = CONFIRM_S,
) -> CommandOutcome:
    """Returns how a cancelled goal has ended: as cancelled only once the daemon says that its task runs no more.

    Args:
        ended: How it ended here.
        running_id: Asks the daemon which task runs; empty: none.
        own_id: The goal's own task; empty: none was seen.
        known_id: The one that ran before.
        limit_s: How long to wait for it.

    """
    try:
        if await ends_within(_until_ended(running_id, own_id, known_id), limit_s):
            return ended
        why = f"no answer in {limit_s:g} s"
    except ual.UalError as error:
        why = f"{error.reason}: {error.message}"
    text = f"{ended.message}. The daemon has not said that it has ended ({why}): it may still fly. Watch `state`"
    return CommandOutcome("TIMEOUT", text, ended.metadata)


async def _until_ended(running_id: Callable[[], Awaitable[str]], own_id: str, known_id: str) -> None:
    """Waits while the goal's task runs. One that was never seen may be any but that which ran before."""
    while _is_meant(await running_id(), own_id, known_id):  # noqa: ASYNC110  a daemon that is asked sets no event
        await asyncio.sleep(AGAIN_S)


def _is_meant(found: str, own_id: str, known_id: str) -> bool:
    return found == own_id if own_id else found not in ("", known_id)
