"""The end where the system has no memory for a thread: everything is done, and there is no traceback."""

from __future__ import annotations

import asyncio
import threading

import pytest

from ual_daemon.program.aside import aside, outcome


def no_thread(_: threading.Thread) -> None:
    raise RuntimeError("can't start new thread")


@pytest.mark.parametrize("has_threads", [True, False])
def test_all_is_done_once_with_a_thread_and_without(has_threads: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []

    async def end() -> str:
        await asyncio.to_thread(done.append, "before")
        if not has_threads:
            monkeypatch.setattr(threading.Thread, "start", no_thread)
        await aside(lambda: done.append("closed"))
        return "safe"

    assert outcome(end()) == "safe"
    assert done == ["before", "closed"]


def test_a_failure_of_the_work_is_raised_where_it_is_waited_for() -> None:
    def fail() -> None:
        raise RuntimeError("of the work")

    with pytest.raises(RuntimeError, match="of the work"):
        outcome(aside(fail))
