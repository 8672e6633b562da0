"""Messages of a wait of the tests that was in vain; no test makes a wait by hand."""

from __future__ import annotations

import ast
import asyncio
import gc
import re
import threading
from collections.abc import Callable, Collection, Iterator, Sequence
from itertools import count
from pathlib import Path
from typing import TypeAlias

import pytest

import ual
from tests.conftest import DaemonProcess
from tests.simulators.pace import Pace
from tests.waiting import is_at_work, until, until_after, until_async, until_state
from ual.types import State, Telemetry

pytest_plugins = ["pytester"]
TESTS = Path(__file__).parent
REAL = ("sitl", "campaign", "simulators")
"""Folders that fly in real time by purpose: real autopilots, and the programs that make and judge their flights."""
CLOCKS = {"time.time", "time.monotonic", "time.perf_counter"}
BY_THE_CLOCK = {
    "clients/ros2/test_independent_stacks.py": "a stamp is of this day",
    "deploy/test_gateway.py": "a stream that ends though nothing comes",
    "ual/lease_pilot.py": "a pilot flies for so long",
    "ual_daemon/backends/airsim/test_airsim_flights.py": "nothing happens for so long",
    "ual_daemon/backends/mavlink/links/test_links.py": "what would last for ever does not last for 10 s",
    "ual_daemon/backends/mavlink/test_backend.py": "nothing comes for so long",
    "ual_daemon/test_threads.py": "the stress lasts as long as is asked for",
    "ual_tools/view/test_view_browser.py": "the page says it before its limit",
}
"""Tests whose condition may look at the clock of the computer, and the reason."""


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


def test_something_else_may_run_between_two_points() -> None:
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


def test_simulated_time_stands_while_the_test_is_at_work() -> None:
    steps: list[int] = []
    is_over = threading.Event()

    def fly() -> None:
        pace = Pace(0.001, 1.0)
        while not is_over.is_set():
            pace.wait()
            steps.append(1)

    thread = threading.Thread(target=fly)
    thread.start()
    until(lambda: len(steps) > 2)
    point = len(steps)
    assert sum(range(10**7)) > 0  # a step takes a hundredth of this
    assert len(steps) - point <= 1  # one may have begun
    until(lambda: len(steps) > point + 1)
    is_over.set()
    thread.join()


def test_who_waits_has_nothing_to_do_until_another_thread_notifies() -> None:
    begins, is_over = threading.Event(), threading.Event()

    def work() -> None:
        begins.wait()
        while not is_over.is_set():
            pass

    thread = threading.Thread(target=work)
    thread.start()
    until(lambda: not is_at_work(thread))
    begins.set()
    assert is_at_work(thread)  # though it may not run yet
    is_over.set()
    thread.join()
    assert not is_at_work(thread)


def test_what_was_there_before_the_point_is_not_waited_for() -> None:
    log = ["done"]
    threading.Timer(0.0, log.append, ["done again"]).start()
    assert until_after(log, len(log[:1]), lambda words: words.startswith("done")) == "done again"
    with pytest.raises(AssertionError, match=r"in vain for: the end; seen last: \[\]"):
        until_after(log, len(log), lambda words: words.startswith("done"), "the end", limit_s=0.0)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_wait_ends_when_a_thread_has_died() -> None:
    def die() -> None:
        raise ValueError("what it died of")

    thread = threading.Thread(target=die, name="the autopilot")
    thread.start()
    with pytest.raises(AssertionError, match=r"'the autopilot' has died: ValueError.*what it died of"):
        until(lambda: False)
    thread.join()


def test_what_a_test_leaves_open_fails_that_test(pytester: pytest.Pytester) -> None:
    pytester.makeconftest("from tests.conftest import closed_at_the_end")
    pytester.makepyfile(
        """
        import socket
        def test_that_leaks():
            ring = [socket.socket()]
            ring.append(ring)
        def test_that_does_not():
            import gc
            gc.collect()
        """
    )
    gc.disable()  # it would find the socket while the test still runs
    try:
        result = pytester.runpytest_inprocess("-W", "error", "-p", "no:cacheprovider")
    finally:
        gc.enable()
    result.assert_outcomes(passed=2, errors=1)
    result.stdout.fnmatch_lines(["*ERROR*test_that_leaks*"])


def test_a_loop_runs_while_it_waits() -> None:
    found: list[int] = []

    async def run() -> bool:
        asyncio.get_running_loop().call_soon(found.append, 1)
        return await until_async(lambda: found == [1])

    assert asyncio.run(run())


def calls_of(node: ast.AST, names: Collection[str]) -> list[ast.Call]:
    return [each for each in ast.walk(node) if isinstance(each, ast.Call) and ast.unparse(each.func) in names]


def sleeps(tree: ast.AST, lines: Sequence[str]) -> Iterator[int]:
    """Sleeps without a reason on their line. To sleep for 0 s lets others run."""
    for call in calls_of(tree, {"time.sleep", "asyncio.sleep"}):
        lasts = not (isinstance(call.args[0], ast.Constant) and not call.args[0].value)
        if lasts and "#" not in lines[call.lineno - 1]:
            yield call.lineno


def conditions_by_the_clock(tree: ast.AST, _: Sequence[str]) -> Iterator[int]:
    """Conditions that a busy computer makes false. It does not make false that something lasted for long enough."""
    for node in ast.walk(tree):
        if isinstance(node, ast.While | ast.Assert):
            is_least = isinstance(node.test, ast.Compare) and isinstance(node.test.ops[0], ast.Gt)
            if calls_of(node.test, CLOCKS) and not (is_least and isinstance(node, ast.Assert)):
                yield node.lineno
        elif isinstance(node, ast.For) and re.match(r"range\(.*LIMIT_S", ast.unparse(node.iter)):
            yield node.lineno


def waits_for_what_was_there(tree: ast.AST, _: Sequence[str]) -> Iterator[int]:
    """Second waits in one function for the same to be in what only grows: `until_after` has a point."""
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
            seen: set[str] = set()
            for call in calls_of(function, {"until", "until_async"}):
                condition = ast.unparse(call.args[0])
                if condition in seen and re.search(r"[^(]* in |any\(", condition):
                    yield call.lineno
                seen.add(condition)


Rule: TypeAlias = Callable[[ast.AST, Sequence[str]], Iterator[int]]
RULES: dict[Rule, str] = {
    sleeps: r"\.sleep\(",
    conditions_by_the_clock: r"(while|assert).*time\.|range\(.*LIMIT_S",
    waits_for_what_was_there: r"until(_async)?\(",
}
"""The rules, each with what is in all that it may find: a parse takes longer than a look."""


def test_no_test_waits_for_a_time_or_for_what_was_there() -> None:
    found = []
    for path in TESTS.rglob("*.py"):
        name, text = path.relative_to(TESTS).as_posix(), path.read_text()
        rules = [rule for rule, words in RULES.items() if re.search(words, text)]
        if rules and name != "waiting.py" and not name.startswith(REAL):
            tree, lines = ast.parse(text), text.splitlines()
            by_rule = {rule: list(rule(tree, lines)) for rule in rules}
            if name in BY_THE_CLOCK:
                assert by_rule.pop(conditions_by_the_clock), f"{name} no longer does"
            found += [f"{name}:{line} {rule.__name__}" for rule, all_of in by_rule.items() for line in all_of]
    assert found == []


@pytest.mark.parametrize(
    ("rule", "text"),
    [
        (sleeps, "time.sleep(0.1)"),
        (conditions_by_the_clock, "assert time.monotonic() < end_s"),
        (conditions_by_the_clock, "while time.time() > 3: pass"),
        (conditions_by_the_clock, "for _ in range(int(LIMIT_S)): pass"),
        (waits_for_what_was_there, "def test():\n until(lambda: 'done' in log)\n until(lambda: 'done' in log)"),
    ],
)
def test_such_a_wait_is_found(rule: Rule, text: str) -> None:
    assert list(rule(ast.parse(text), text.splitlines())) == [text.count("\n") + 1]


def test_a_daemon_tells_of_an_event_once(daemon: DaemonProcess) -> None:
    armed = daemon.wait_for("state", new="LANDED_ARMED")
    with pytest.raises(AssertionError, match="was there already: after which event"):
        daemon.wait_for("state", new="LANDED_ARMED")
    with ual.Uav(address=daemon.address) as uav:
        uav.take_off(2.0)
        uav.land()
    daemon.wait_for("state", after=armed, new="LANDED_ARMED")
