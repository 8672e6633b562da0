"""What a wait of the tests says when it was in vain, and that no test makes one by hand."""

from __future__ import annotations

import asyncio
import re
from itertools import count
from pathlib import Path

import pytest

from tests.waiting import until, until_async, until_state
from ual.types import State, Telemetry

TESTS = Path(__file__).parent
BY_HAND = re.compile(r"assert time\.monotonic\(\) < |range\(.*LIMIT_S")
NOT_WAITS = {"waiting.py", "test_waiting.py", "test_others.py", "test_authority.py"}
"""The last two measure how fast a real autopilot is."""


class Grounded:
    """A UAV that never flies."""

    def is_ready(self) -> bool:
        return False

    def state(self) -> State:
        return State.LANDED_ARMED

    def telemetry(self) -> Telemetry:
        return Telemetry(state=self.state(), state_reason="it stands")


def test_the_first_true_answer_is_returned() -> None:
    numbers = count()
    assert until(lambda: next(numbers) // 2) == 1
    assert next(numbers) == 3


def test_something_else_may_run_between_two_looks() -> None:
    found: list[int] = []
    until(lambda: len(found) == 3, between=lambda: found.append(1))
    assert found == [1, 1, 1]


def test_a_wait_in_vain_says_what_it_waited_for_and_saw() -> None:
    with pytest.raises(AssertionError, match="0 s in vain for: the landing; seen last: 12 m"):
        until(lambda: False, "the landing", seen=lambda: "12 m", limit_s=0.0)


def test_without_words_it_says_the_condition_and_its_answer() -> None:
    height_m = 0
    with pytest.raises(AssertionError, match=r"until\(lambda: height_m, limit_s=0.0\); seen last: 0"):
        until(lambda: height_m, limit_s=0.0)
    with pytest.raises(AssertionError, match=r"for: Grounded\.is_ready; seen last: False"):
        until(Grounded().is_ready, limit_s=0.0)


def test_a_wait_for_a_state_says_the_telemetry() -> None:
    with pytest.raises(AssertionError, match=r"FLYING_AUTO or LANDING; seen last: (.|\n)*it stands"):
        until_state(Grounded(), State.FLYING_AUTO, State.LANDING, limit_s=0.0)


def test_a_loop_runs_while_it_waits() -> None:
    found: list[int] = []

    async def run() -> bool:
        asyncio.get_running_loop().call_soon(found.append, 1)
        return await until_async(lambda: found == [1])

    assert asyncio.run(run())


def test_no_test_waits_by_hand() -> None:
    by_hand = [
        f"{path.relative_to(TESTS)}:{number}"
        for path in TESTS.rglob("*.py")
        if path.name not in NOT_WAITS
        for number, line in enumerate(path.read_text().splitlines(), 1)
        if BY_HAND.search(line)
    ]
    assert by_hand == []
