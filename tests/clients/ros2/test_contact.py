"""The contact to a daemon: nothing that moves is sent into a stalled connection, and a cancel is told when it holds."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator

import pytest

import ual
from ual_ros2.contact import QUIET_S, DaemonContact, confirmed
from ual_ros2.outcome import CommandOutcome

CANCELLED = CommandOutcome("TASK_ABORTED", "cancelled: the ROS client", {"by": "the ROS client"})


class Daemon:
    """A daemon that answers, refuses, or does not answer."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.asked_count = 0
        self.is_stalled = False
        self.refusal: ual.UalError | None = None

    async def ask(self) -> None:
        self.asked_count += 1
        if self.refusal is not None:
            raise self.refusal
        if self.is_stalled:
            await asyncio.get_running_loop().create_future()


def test_a_daemon_that_is_received_is_not_queried() -> None:
    async def run() -> None:
        daemon = Daemon()
        contact = DaemonContact(daemon.ask, 30.0, lambda: daemon.now_s)
        daemon.is_stalled = True
        await contact.require(0.01)
        daemon.now_s = 10.0
        contact.note()
        daemon.now_s += QUIET_S
        await contact.require(0.01)
        assert daemon.asked_count == 0

    asyncio.run(run())


def test_a_quiet_daemon_is_queried_and_only_one_that_answers_gets_what_moves() -> None:
    async def run() -> None:
        daemon = Daemon()
        contact = DaemonContact(daemon.ask, 30.0, lambda: daemon.now_s)
        daemon.now_s = 0.3
        await contact.require(0.01)  # it answers: time stands in its simulation, say
        assert daemon.asked_count == 1
        daemon.is_stalled = True
        with pytest.raises(ual.DaemonUnreachableError, match=r"does not answer within 0\.01 s: this is not sent"):
            await contact.require(0.01)
        daemon.refusal = ual.UnauthenticatedError("revoked")
        with pytest.raises(ual.UnauthenticatedError):
            await contact.require(0.01)

    asyncio.run(run())


def test_a_stream_of_setpoints_goes_on_through_the_gaps_of_a_slow_link() -> None:
    async def run() -> None:
        daemon = Daemon()
        contact = DaemonContact(daemon.ask, 30.0, lambda: daemon.now_s)
        daemon.is_stalled = True
        daemon.now_s = 0.5
        await contact.require(0.01, quiet_s=0.5)
        daemon.now_s = 0.6
        with pytest.raises(ual.DaemonUnreachableError):
            await contact.require(0.01, quiet_s=0.5)

    asyncio.run(run())


def test_a_slow_rate_is_no_silence() -> None:
    async def run() -> None:
        daemon = Daemon()
        contact = DaemonContact(daemon.ask, 2.0, lambda: daemon.now_s)
        daemon.now_s = 1.4
        await contact.require(0.01)
        assert daemon.asked_count == 0

    asyncio.run(run())


def test_a_cancel_that_comes_with_the_answer_is_not_lost() -> None:
    """Else a cancelled goal would be sent, and fly."""

    async def run() -> bool:
        answered: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        now_s = 0.0
        contact = DaemonContact(lambda: answered, 30.0, lambda: now_s)
        now_s = 10.0
        requiring = asyncio.ensure_future(contact.require(3.0))
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        answered.set_result(None)
        requiring.cancel()
        await asyncio.wait((requiring,))
        return requiring.cancelled()

    assert asyncio.run(run())


@pytest.mark.parametrize(
    ("running", "own_id", "asked_count"),
    [
        (["own", "own", ""], "own", 3),
        (["own", "next"], "own", 2),
        (["unseen", "before"], "", 2),
        ([""], "", 1),
    ],
)
def test_a_cancel_is_reported_once_the_task_runs_no_more(running: list[str], own_id: str, asked_count: int) -> None:
    answers: Iterator[str] = iter(running)
    told: list[str] = []

    async def running_id() -> str:
        told.append(next(answers))
        return told[-1]

    assert asyncio.run(confirmed(CANCELLED, running_id, own_id, "before")) is CANCELLED
    assert len(told) == asked_count


def test_a_cancel_that_the_daemon_does_not_confirm_is_none() -> None:
    daemon = Daemon()

    async def running_id() -> str:
        await daemon.ask()
        return "own"

    goes_on = asyncio.run(confirmed(CANCELLED, running_id, "own", "", limit_s=0.01))
    assert (goes_on.reason, goes_on.is_success) == ("TIMEOUT", False)
    assert goes_on.message.startswith("cancelled: the ROS client. The daemon has not said that it has ended (no answer")
    daemon.refusal = ual.DaemonUnreachableError("it is gone")
    unknown = asyncio.run(confirmed(CANCELLED, running_id, "own", ""))
    assert unknown.reason == "TIMEOUT"
    assert "DAEMON_UNREACHABLE: it is gone" in unknown.message
