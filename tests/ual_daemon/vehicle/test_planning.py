from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator

import pytest

from tests.waiting import LIMIT_S
from ual.errors import InvalidArgumentError, ResourceExhaustedError
from ual_daemon import logs
from ual_daemon.server.waiting import ended
from ual_daemon.vehicle.planning import MOST_PLANS_AT_ONCE, Planning


@pytest.fixture
def gate() -> Iterator[threading.Event]:
    """Plans that wait for it end with the test."""
    gate = threading.Event()
    yield gate
    gate.set()


def test_more_plans_than_a_few_at_once_are_refused_until_one_is_ready(gate: threading.Event) -> None:
    planning = Planning()
    running = [planning.begin("follow_path", gate.wait) for _ in range(MOST_PLANS_AT_ONCE)]
    with pytest.raises(ResourceExhaustedError, match="follow_path: 2 paths are being planned") as caught:
        planning.begin("follow_path", gate.wait)
    assert caught.value.metadata["limit"] == "2"
    gate.set()
    assert [each.result(LIMIT_S) for each in running] == [True, True]
    assert planning.begin("follow_path", lambda: 3).result(LIMIT_S) == 3


def test_a_plan_that_fails_gives_its_error_and_its_room() -> None:
    planning = Planning()

    def fail() -> None:
        raise InvalidArgumentError("waypoints: none")

    for _ in range(2 * MOST_PLANS_AT_ONCE):
        assert isinstance(planning.begin("follow_path", fail).exception(LIMIT_S), InvalidArgumentError)


def test_a_plan_for_which_there_is_no_thread_is_refused_and_gives_its_room(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    planning = Planning()
    with monkeypatch.context() as full:
        full.setattr(threading.Thread, "start", fail)
        for _ in range(MOST_PLANS_AT_ONCE):
            with pytest.raises(ResourceExhaustedError, match="follow_path: this computer starts no more threads"):
                planning.begin("follow_path", lambda: 3)
    assert planning.figures.running_count == 0
    assert planning.begin("follow_path", lambda: 3).result(LIMIT_S) == 3


def test_plans_are_counted_with_how_long_they_took(gate: threading.Event) -> None:
    planning = Planning()
    plan = planning.begin("follow_path", gate.wait)
    assert planning.figures == (1, 0, 0.0)
    gate.set()
    plan.result(LIMIT_S)
    assert planning.figures[:2] == (0, 1)
    assert planning.figures.ended_s > 0.0


def test_the_log_rows_of_a_plan_name_the_caller() -> None:
    token = logs.caller.set(lambda: "ipv4:127.0.0.1:1")
    try:
        who = Planning().begin("follow_path", logs.caller.get).result(LIMIT_S)
    finally:
        logs.caller.reset(token)
    assert who is not None
    assert who() == "ipv4:127.0.0.1:1"


def test_an_event_loop_ends_while_paths_are_planned(gate: threading.Event) -> None:
    async def serve() -> None:
        waiting = asyncio.create_task(ended(Planning().begin("follow_path", gate.wait)))
        await asyncio.sleep(0.0)
        waiting.cancel()

    daemon = threading.Thread(target=lambda: asyncio.run(serve()), daemon=True)
    daemon.start()
    daemon.join(LIMIT_S)
    assert not daemon.is_alive()
