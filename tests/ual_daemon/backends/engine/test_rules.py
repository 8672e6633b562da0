"""Whatever the autopilot, its pilot, the link and this computer do: no command leaves that the pilot's rules forbid.

`UAL_TEST_ENGINE_EXAMPLES=100000` looks for longer, and for engines in which a rule was removed, too.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import partialmethod
from typing import NamedTuple

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from tests.ual_daemon.backends.engine.scripted import COMMANDS, MODES, BrokenRuleError, Order, Scripted
from ual_daemon.backends.engine import command_runner
from ual_daemon.backends.engine.command import Verdict
from ual_daemon.backends.engine.command_runner import CommandRunner
from ual_daemon.backends.engine.link_watch import LinkWatch

EXAMPLES_COUNT = int(os.environ.get("UAL_TEST_ENGINE_EXAMPLES", "150"))
THOROUGH_COUNT = 2000
"""From so many examples on, the search finds each of the engines without a rule, too."""


@dataclass(frozen=True)
class Event:
    """Something that happens, with a number or a name that says which."""

    what: str
    which: int | float | str = 0


def _events(
    what: str, which: st.SearchStrategy[int] | st.SearchStrategy[float] | st.SearchStrategy[str]
) -> st.SearchStrategy[Event]:
    return st.builds(Event, st.just(what), which)


RECENT = st.integers(-3, -1)
ASKED = _events("ask", st.sampled_from(sorted(COMMANDS)))
SHORT = _events("wait", st.sampled_from([0.05, 0.1, 0.3]))
WAITED = _events("wait", st.sampled_from([0.05, 0.1, 0.3, 0.6, 1.5, 5.0]))
OTHERS = st.one_of(
    _events("withdraw", RECENT),
    _events("pilot", st.sampled_from(MODES)),
    _events("arm", st.integers(0, 1)),
    _events("obey", RECENT),
    _events("pause", st.sampled_from([0.1, 0.3, 0.8, 1.2, 4.0])),
    _events("reboot", st.just(0)),
)
ANSWERED = st.one_of(*(_events(what, RECENT) for what in ("accepted", "passed on", "in progress", "refused", "lost")))
SWITCHED = st.one_of(*(_events(what, st.integers(0, 1)) for what in ("silent", "state", "setpoints", "held up")))
EVENT = st.one_of(ASKED, WAITED, OTHERS, ANSWERED, SWITCHED)


def _scene(*events: st.SearchStrategy[Event]) -> st.SearchStrategy[list[Event]]:
    return st.tuples(*events).map(list)


def _episode(what: str, begun: int) -> st.SearchStrategy[list[Event]]:
    """Returns scenes in which something is switched, and back: most of what else happens comes to nothing meanwhile."""

    def switched(during: list[Event]) -> list[Event]:
        return [Event(what, begun), *during, Event(what, 1 - begun)]

    return st.lists(EVENT, min_size=1, max_size=4).map(switched)


SCENES = st.one_of(
    _scene(EVENT),
    _scene(ASKED, SHORT),
    _scene(ASKED, SHORT, OTHERS, WAITED),
    _scene(ASKED, SHORT, ANSWERED, WAITED, OTHERS, WAITED),
    _scene(ASKED, OTHERS, WAITED),
    _episode("silent", 1),
    _episode("state", 0),
    _episode("held up", 1),
    _episode("setpoints", 1),
)
SCRIPTS = st.lists(SCENES, min_size=1, max_size=12).map(lambda scenes: list(itertools.chain.from_iterable(scenes)))
"""Any events in any order. Most are of scenes in which commands are under way, as only then a rule can be broken."""
VERDICTS = {
    "accepted": Verdict.ACCEPTED,
    "passed on": Verdict.PASSED_ON,
    "in progress": Verdict.IN_PROGRESS,
    "refused": Verdict.REFUSED,
    "lost": Verdict.LOST,
}


def run(script: list[Event]) -> Scripted:
    """Plays a script. The judge raises where a rule is broken."""
    scripted, orders = Scripted(), list[Order]()
    scripted.wait(0.2)
    for event in script:
        _play(scripted, orders, event)
    scripted.wait(2.0)
    return scripted


def _play(scripted: Scripted, orders: list[Order], event: Event) -> None:  # noqa: C901  a table of events
    which = event.which
    if event.what in VERDICTS:
        assert isinstance(which, int)
        scripted.answer(VERDICTS[event.what], which)
    elif event.what == "wait":
        scripted.wait(float(which))
    elif event.what == "pause":
        scripted.pause(float(which))
    elif event.what == "ask":
        orders.append(scripted.ask(str(which)))
    elif event.what == "withdraw" and orders:
        assert isinstance(which, int)
        orders[which % len(orders)].result.cancel()
    elif event.what == "pilot":
        scripted.mode = str(which)
    elif event.what == "arm":
        scripted.is_armed = bool(which)
    elif event.what == "silent":
        scripted.is_silent = bool(which)
    elif event.what == "state":
        scripted.says_state = bool(which)
    elif event.what == "setpoints":
        scripted.send_setpoints(flow=bool(which))
    elif event.what == "held up":
        scripted.judge.is_held_up = bool(which)
    elif event.what == "obey":
        assert isinstance(which, int)
        scripted.obey(which)
    elif event.what == "reboot":
        scripted.reboot()


@settings(max_examples=EXAMPLES_COUNT)
@given(SCRIPTS)
def test_no_command_leaves_that_the_rules_forbid(script: list[Event]) -> None:
    run(script)


@given(st.sampled_from(sorted(COMMANDS)))
def test_a_command_leaves_where_nothing_forbids_it(name: str) -> None:
    """So the property is not empty: the engine sends."""
    scripted = run([Event("setpoints", 1), Event("ask", name), Event("wait", 0.6)])
    assert scripted.requests[0] == COMMANDS[name].request


def _without(owner: type, name: str, instead: object) -> Callable[[pytest.MonkeyPatch], None]:
    return lambda patch: patch.setattr(owner, name, instead)


def _ignoring_bridges(self: CommandRunner[str], *args: object, hindrance: object, real: Callable[..., None]) -> None:
    del hindrance
    real(self, *args)


def _again_into_silences(self: CommandRunner[str], *args: object, real: Callable[..., str]) -> str:
    pending = args[0]
    assert isinstance(pending, command_runner._PendingCommand)
    return "" if pending.sends_count else real(self, *args)


class Mutation(NamedTuple):
    """An engine in which a rule was removed, and the shortest script that the search has found to show it."""

    apply: Callable[[pytest.MonkeyPatch], None]
    script: tuple[tuple[str, int | float | str], ...]


MUTATIONS = {
    "into a silence": Mutation(
        _without(LinkWatch, "why_silent", lambda *_: ""), (("silent", 1), ("wait", 0.3), ("ask", "arm"))
    ),
    "again without a sign of life": Mutation(
        _without(CommandRunner, "_hindrance", partialmethod(_again_into_silences, real=CommandRunner._hindrance)),
        (("ask", "arm"), ("wait", 0.05), ("silent", 1), ("wait", 0.6)),
    ),
    "again after a silence": Mutation(
        _without(CommandRunner, "_has_missed", lambda *_: False),
        (("ask", "arm"), ("wait", 0.05), ("silent", 1), ("wait", 0.3), ("silent", 0), ("wait", 0.3)),
    ),
    "before what it changes was heard": Mutation(
        _without(CommandRunner, "_unknown", lambda *_: ""), (("ask", "arm"), ("state", 0), ("pause", 0.3))
    ),
    "over a mode that others chose": Mutation(
        _without(CommandRunner, "_judge_modes", lambda *_: None), (("ask", "arm in hold"), ("pilot", "setpoints"))
    ),
    "while blind": Mutation(_without(LinkWatch, "on_blind", lambda *_: None), (("ask", "arm"), ("pause", 0.3))),
    "executed late": Mutation(
        _without(CommandRunner, "__init__", partialmethod(_ignoring_bridges, real=CommandRunner.__init__)),
        (("ask", "arm"), ("held up", 1)),
    ),
    "again before the bridge has answered": Mutation(
        _without(CommandRunner, "_not_again", lambda *_: ""), (("ask", "arm through a bridge"), ("wait", 1.5))
    ),
    "without setpoints": Mutation(
        lambda patch: patch.setattr(command_runner, "SETPOINTS_WAIT_S", -1.0), (("ask", "take control"),)
    ),
    "of another boot": Mutation(
        _without(CommandRunner, "drop", lambda *_: None), (("ask", "arm"), ("wait", 0.05), ("reboot", 0))
    ),
    "withdrawn": Mutation(
        lambda patch: patch.setattr(command_runner._PendingCommand, "is_withdrawn", property(lambda _: False)),
        (("ask", "arm"), ("wait", 0.05), ("withdraw", -1)),
    ),
}


@pytest.mark.parametrize("rule", sorted(MUTATIONS))
def test_an_engine_without_one_of_the_rules_is_found(rule: str, monkeypatch: pytest.MonkeyPatch) -> None:
    mutation = MUTATIONS[rule]
    script = [Event(*each) for each in mutation.script]
    run(script)
    mutation.apply(monkeypatch)
    with pytest.raises(BrokenRuleError, match=rule):
        run(script)


@pytest.mark.skipif(EXAMPLES_COUNT < THOROUGH_COUNT, reason="only where UAL_TEST_ENGINE_EXAMPLES asks for it")
@pytest.mark.parametrize("rule", sorted(MUTATIONS))
def test_the_search_finds_an_engine_without_one_of_the_rules(rule: str, monkeypatch: pytest.MonkeyPatch) -> None:
    MUTATIONS[rule].apply(monkeypatch)

    @settings(max_examples=EXAMPLES_COUNT, phases=[Phase.generate], report_multiple_bugs=False)
    @given(SCRIPTS)
    def poll_once(script: list[Event]) -> None:
        run(script)

    with pytest.raises(BrokenRuleError):
        poll_once()
