"""Commands are sent as their table says, and their futures end accordingly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from tests.snapshots import changed
from tests.ual_daemon.backends.engine.scripted import (
    AGAIN,
    BRIDGED,
    Scripted,
    arm_command,
    mode_command,
)
from ual.errors import LinkLostError, RejectedByAutopilotError, UalTimeoutError
from ual_daemon.backends.engine.command import FLYING, ONCE, Command, Verdict
from ual_daemon.backends.engine.command_runner import EFFECT_S, MOST_TEXTS, CommandRunner, RunnerSettings
from ual_daemon.backends.engine.limits import SETPOINTS_WAIT_S, UNSENT_COMMAND_S
from ual_daemon.backends.engine.link_watch import LinkWatch
from ual_daemon.backends.values import Control, LandedState, Mode, OnArming, Sample, Snapshot


class Plain:
    """A runner without a loop: the test says what is known."""

    def __init__(
        self,
        settings: RunnerSettings = RunnerSettings(),  # noqa: B008  it is immutable
        transmit: Callable[[str, int, object], Callable[[], object] | None] | None = None,
    ) -> None:
        self.now_s = 10.0
        self.known = Snapshot(0.0)
        self.sent: list[str] = []
        self.keys: list[object] = []
        self.taken_back: list[str] = []
        self.why_late = ""
        self.watch = LinkWatch("plain", 1.0)
        self.runner: CommandRunner[str] = CommandRunner(
            "Hover",
            transmit or self._transmit,
            lambda now_s: self.known._replace(time_s=now_s),
            self.watch,
            lambda _: 0.0,
            settings,
            lambda: self.why_late,
        )
        self.hear("manual")

    def hear(
        self,
        mode: str,
        *,
        is_armed: bool = False,
        control: Control = Control.OTHER,
        on_arming: OnArming = OnArming.STANDS,
    ) -> None:
        self.watch.on_message(self.now_s)
        self.known = changed(
            self.known,
            heard_s=self.now_s,
            mode=Sample(Mode(mode, control, on_arming=on_arming), self.now_s),
            armed=Sample(is_armed, self.now_s),
        )
        self.runner.on_state(self.now_s)

    def run(self, duration_s: float, mode: str = "manual") -> None:
        """Time passes while the autopilot says that it is in a mode; none: it says nothing."""
        for _ in range(round(duration_s / 0.05)):
            self.now_s += 0.05
            if mode:
                self.hear(mode)
            self.runner.tick(self.now_s)

    def answer(self, verdict: Verdict, text: str = "", by: str = "") -> None:
        self.runner.on_answer(self.keys[-1], verdict, self.now_s, text, by)

    def _transmit(self, request: str, sent_before_count: int, key: object) -> Callable[[], object]:
        del sent_before_count
        self.sent.append(request)
        self.keys.append(key)
        return lambda: self.taken_back.append(request)


@pytest.fixture
def plain() -> Plain:
    return Plain()


def test_what_may_be_sent_once_is_sent_once(plain: Plain) -> None:
    future = plain.runner.submit(mode_command("hold", ONCE), plain.now_s)
    plain.run(10.0)
    assert plain.sent == ["mode hold"]
    assert not future.done()


def test_a_command_waits_for_the_end_of_a_silence_and_says_in_the_end_what_kept_it_back(plain: Plain) -> None:
    plain.run(0.5, mode="")
    waiting = plain.runner.submit(mode_command("hold"), plain.now_s)
    plain.run(1.0, mode="")
    assert plain.sent == []
    plain.run(0.05)
    assert plain.sent == ["mode hold"]
    plain.run(0.5, mode="")
    unsent = plain.runner.submit(mode_command("land"), plain.now_s)
    plain.run(UNSENT_COMMAND_S + 0.1, mode="")
    assert isinstance(unsent.exception(0), UalTimeoutError)
    assert "the command to enter land was not sent: nothing was heard of the autopilot for 5." in str(
        unsent.exception(0)
    )
    assert not waiting.done()


def test_what_is_harmless_leaves_also_into_a_silence_and_a_late_bridge(plain: Plain) -> None:
    plain.why_late = "the bridge is late"
    plain.run(3.0, mode="")
    plain.runner.submit(Command("give up the authority", "release", "release", is_harmless=True), plain.now_s)
    assert plain.sent == ["release"]


def test_a_command_waits_while_its_table_or_the_bridge_says_so(plain: Plain) -> None:
    flying = ["it says that it still flies"]
    disarm = replace(arm_command(is_armed=False), waits=lambda _: "".join(flying))
    plain.why_late = "the bridge is late"
    plain.runner.submit(disarm, plain.now_s)
    plain.run(0.2)
    plain.why_late = ""
    plain.run(0.2)
    assert plain.sent == []
    flying.clear()
    plain.run(0.05)
    assert plain.sent == ["disarm"]


def test_a_mode_that_needs_setpoints_leaves_in_the_end_without_them(plain: Plain) -> None:
    plain.runner.submit(mode_command("setpoints", setpoints_before_s=0.4), plain.now_s)
    plain.run(SETPOINTS_WAIT_S - 0.1)
    assert plain.sent == []
    plain.run(0.1)
    assert plain.sent == ["mode setpoints"]


def test_a_mode_that_was_not_reported_just_now_keeps_back_what_a_bridge_executes_late(plain: Plain) -> None:
    plain.runner.submit(replace(mode_command("hold"), mode_age_s=0.01), plain.now_s)
    assert plain.sent == ["mode hold"]
    plain.now_s += 0.02
    plain.runner.submit(replace(mode_command("land"), mode_age_s=0.01), plain.now_s)
    assert plain.sent == ["mode hold"]
    plain.hear("manual")
    plain.runner.tick(plain.now_s)
    assert plain.sent == ["mode hold", "mode land"]


def test_through_a_bridge_it_is_queried_again_only_where_the_autopilot_shows_that_it_was_not_done() -> None:
    plain = Plain(RunnerSettings(bridge="the bridge"))
    future = plain.runner.submit(mode_command("hold", BRIDGED), plain.now_s)
    plain.run(2.0)
    assert plain.sent == ["mode hold"]  # unanswered: it may still be executed
    plain.answer(Verdict.PASSED_ON)
    plain.run(0.2)
    assert plain.sent == ["mode hold"]
    plain.run(0.2)
    assert plain.sent == ["mode hold"] * 2
    plain.run(0.05, mode="hold")
    assert future.result(0) is None


def test_a_bridge_that_does_not_answer_is_named_and_one_that_has_is_explained_by_texts() -> None:
    plain = Plain(RunnerSettings(bridge="the bridge"))
    future = plain.runner.submit(mode_command("hold", BRIDGED), plain.now_s)
    plain.run(UNSENT_COMMAND_S + 0.1)
    assert str(future.exception(0)) == (
        "the bridge has not answered the command to enter hold, which may still be executed"
    )
    assert plain.taken_back == ["mode hold"]
    future = plain.runner.submit(mode_command("hold", BRIDGED), plain.now_s)
    plain.answer(Verdict.PASSED_ON)
    plain.runner.on_text("no position")
    for _ in range(5):
        plain.run(0.95)
        plain.answer(Verdict.PASSED_ON)
    error = future.exception(0)
    assert isinstance(error, RejectedByAutopilotError)
    assert str(error) == "Hover refused to enter hold: the mode was not entered; it said: no position"
    assert error.metadata == {"result": "the mode was not entered", "text": "no position"}


def test_requests_for_data_wait_for_their_answers_and_repetitions_and_cost_nothing_meanwhile(
    plain: Plain, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks: list[float] = []
    look = plain.runner._give_up_late_ones

    def counted(now_s: float) -> None:
        looks.append(now_s)
        look(now_s)

    monkeypatch.setattr(plain.runner, "_give_up_late_ones", counted)
    first, second = (Command(f"send {each}", each, key=1, repeat=AGAIN) for each in ("this", "that"))
    plain.runner.submit(first, plain.now_s)
    done = plain.runner.submit(second, plain.now_s)
    plain.run(1.9 * AGAIN.every_s)
    assert plain.sent == ["this", "this"]
    assert len(looks) in (2, 3)
    plain.answer(Verdict.ACCEPTED)
    assert plain.sent[-1] == "that"
    plain.answer(Verdict.ACCEPTED)
    assert done.done()
    plain.runner.submit(arm_command(is_armed=True), plain.now_s)
    looks.clear()
    plain.run(0.5)
    assert len(looks) == 10


def test_a_lost_answer_ends_a_command_which_is_not_sent_again(plain: Plain) -> None:
    future = plain.runner.submit(mode_command("hold"), plain.now_s)
    plain.answer(Verdict.LOST)
    plain.run(3.0)
    assert isinstance(future.exception(0), UalTimeoutError)
    assert plain.sent == ["mode hold"]


def test_a_refusal_that_is_not_final_is_believed_at_the_end_of_the_repetitions(plain: Plain) -> None:
    arm = replace(arm_command(is_armed=True), refusal_is_final=False)
    future = plain.runner.submit(arm, plain.now_s)
    plain.answer(Verdict.REFUSED, "just landed")
    plain.run(4.0)
    assert len(plain.sent) > 10
    assert not future.done()
    plain.run(2.0)
    assert str(future.exception(0)) == "Hover refused to arm: just landed"


@pytest.mark.parametrize("silent_s", [0.3, 1.5])
def test_what_others_have_undone_in_a_silence_is_not_sent_again_after_it(silent_s: float) -> None:
    """The vehicle has armed, or entered the mode, and its pilot has changed that back, all of it unheard."""
    for name in ("arm", "hold"):
        scripted = Scripted()
        scripted.wait(0.2)
        order = scripted.ask(name)
        scripted.wait(0.05)
        scripted.is_silent = True
        scripted.wait(silent_s)
        scripted.is_silent = False
        scripted.wait(3.0)
        assert len(scripted.requests) == 1
        text = "which is not sent again after a silence: others may have acted in it"
        assert str(order.result.exception(0)).endswith(text)


def test_what_leads_out_of_our_own_mode_is_sent_again_after_a_silence() -> None:
    scripted = Scripted()
    scripted.mode = "setpoints"
    scripted.wait(0.2)
    scripted.ask("land")
    scripted.wait(0.05)
    scripted.is_silent = True
    scripted.wait(0.3)
    scripted.is_silent = False
    scripted.wait(0.1)
    assert scripted.requests == ["mode land"] * 2


def test_an_effect_that_shows_after_a_silence_ends_the_command(plain: Plain) -> None:
    future = plain.runner.submit(mode_command("hold"), plain.now_s)
    plain.run(0.5, mode="")
    plain.run(0.4)
    assert not future.done()
    plain.run(0.05, mode="hold")
    assert future.result(0) is None
    assert plain.sent == ["mode hold"]


def test_the_refusal_of_a_repetition_waits_for_the_effect_of_the_first(plain: Plain) -> None:
    future = plain.runner.submit(mode_command("hold"), plain.now_s)
    plain.run(0.3)
    plain.answer(Verdict.REFUSED, "in it already")
    plain.run(EFFECT_S / 2.0)
    assert not future.done()
    plain.run(0.05, mode="hold")
    assert future.result(0) is None


def test_who_refuses_is_named_and_a_flood_of_texts_is_not_kept(plain: Plain) -> None:
    future = plain.runner.submit(mode_command("hold"), plain.now_s)
    for number in range(1000):
        plain.runner.on_text(f"text {number}")
    plain.answer(Verdict.REFUSED, "no such service", by="the bridge")
    plain.run(0.2)
    text = str(future.exception(0))
    assert text.startswith("the bridge refused to enter hold: no such service; it said: text 0")
    assert text.count("it said") == MOST_TEXTS


def test_modes_of_ones_own_may_have_several_names(plain: Plain) -> None:
    take_control = Command(
        "take control",
        "obtain",
        "mode",
        own_modes=lambda mode: mode.control is Control.REFERENCES,
        repeat=mode_command("hold").repeat,
    )
    plain.runner.submit(take_control, plain.now_s)
    plain.now_s += 0.05
    plain.hear("SDK (P_GPS)", control=Control.REFERENCES)
    plain.run(0.5, mode="")
    sent_count = len(plain.sent)
    plain.now_s += 0.05
    plain.hear("SDK (JOYSTICK)", control=Control.REFERENCES)
    plain.runner.tick(plain.now_s)
    assert plain.sent == ["obtain"] * (sent_count + 1)
    plain.run(3.0, mode="manual")  # others
    assert plain.sent == ["obtain"] * (sent_count + 1)


def test_what_follows_is_sent_in_the_mode_before_or_that_of_its_predecessor_and_in_no_other(plain: Plain) -> None:
    climb = Command("climb", "climb", FLYING, mode="guided", repeat=AGAIN)
    for mode, is_sent in (("manual", True), ("guided", True), ("land", False)):
        plain.run(3.0)
        plain.sent.clear()
        plain.runner.submit(replace(mode_command("guided"), then=climb), plain.now_s)
        plain.answer(Verdict.ACCEPTED)
        plain.run(0.05, mode="manual")
        plain.sent.clear()
        plain.run(0.4, mode=mode)
        assert bool(plain.sent) is is_sent
        plain.runner.drop(plain.now_s)


def test_what_follows_a_mode_that_has_shown_is_not_sent_in_one_that_others_chose_then(plain: Plain) -> None:
    climb = Command("climb", "climb", FLYING, mode="guided", repeat=AGAIN)
    plain.runner.submit(replace(mode_command("guided"), then=climb), plain.now_s)
    plain.why_late = "the bridge is late"
    plain.run(0.1, mode="guided")
    plain.why_late = ""
    plain.now_s += 0.05
    plain.hear("land")
    plain.run(3.0, mode="land")
    assert plain.sent == ["mode guided"]


def test_what_was_replaced_withdrawn_or_overtaken_is_taken_back_and_what_has_succeeded_is_not(plain: Plain) -> None:
    plain.runner.submit(mode_command("hold"), plain.now_s)
    future = plain.runner.submit(mode_command("land"), plain.now_s)
    assert plain.taken_back == ["mode hold"]
    future.cancel()
    plain.run(0.05)
    assert plain.taken_back == ["mode hold", "mode land"]
    plain.run(3.0)
    plain.runner.submit(mode_command("hold"), plain.now_s)
    plain.run(0.05, mode="manual of others")
    assert plain.taken_back == ["mode hold", "mode land", "mode hold"]
    done = plain.runner.submit(mode_command("hold"), plain.now_s)
    plain.answer(Verdict.ACCEPTED)
    assert done.result(0) is None
    assert len(plain.taken_back) == 3


def test_a_command_that_waited_while_others_chose_a_mode_says_so(plain: Plain) -> None:
    future = plain.runner.submit(mode_command("setpoints", setpoints_before_s=0.4), plain.now_s)
    plain.run(0.05, mode="land")
    assert str(future.exception(0)) == "the command to enter setpoints was not sent: the mode became land"


@pytest.mark.parametrize("verdict", [None, Verdict.ACCEPTED])
def test_a_command_that_was_sent_before_others_chose_a_mode_is_not_reported_to_be_unsent(
    plain: Plain, caplog: pytest.LogCaptureFixture, verdict: Verdict | None
) -> None:
    """A link that stalls may bring it to the autopilot later."""
    plain.runner.submit(replace(mode_command("hold"), accepts_count=2), plain.now_s)
    if verdict is not None:
        plain.answer(verdict)
    plain.run(0.05, mode="land")
    late = ", and may still be executed" if verdict is None else ""
    assert caplog.messages == [f"the command to enter hold is not sent again{late}: the mode became land"]


@pytest.mark.parametrize("is_armed_anew", [False, True])
def test_on_the_ground_a_mode_that_shows_late_is_that_of_the_arming_and_any_other_is_a_take_over(
    plain: Plain, *, is_armed_anew: bool
) -> None:
    """Armed shows at once, the mode in which the pilot has armed it up to a second later."""
    plain.known = changed(plain.known, landed=Sample(LandedState.ON_GROUND, plain.now_s))
    if is_armed_anew:
        plain.now_s += 0.05
        plain.known = changed(plain.known, armed=Sample(True, plain.now_s))
    plain.why_late = "no setpoints yet"
    future = plain.runner.submit(mode_command("setpoints"), plain.now_s)
    plain.run(0.05, mode="hold")
    plain.why_late = ""
    plain.run(0.05, mode="hold")
    assert plain.sent == (["mode setpoints"] if is_armed_anew else [])
    assert future.done() is not is_armed_anew


def test_the_end_of_a_step_is_reported_and_the_mode_is_wanted_while_a_command_waits_for_it(plain: Plain) -> None:
    done: list[str] = []
    step = replace(mode_command("hold"), on_done=lambda: done.append("hold"))
    plain.run(0.5, mode="")
    assert not plain.runner.wants_state(plain.now_s)
    plain.runner.submit(step, plain.now_s)
    assert plain.runner.wants_state(plain.now_s)
    plain.run(0.05)
    plain.answer(Verdict.ACCEPTED)
    assert done == ["hold"]


# --- From any thread, by the desk -------------------------------------------------------------------------------------


def test_a_command_from_any_thread_ends_in_its_future() -> None:
    scripted = Scripted()
    scripted.wait(0.2)
    order = scripted.ask("hold")
    assert scripted.requests == []
    scripted.wait(0.05)
    scripted.obey()
    scripted.wait(0.05)
    assert order.result.result(0) is None


def test_without_a_vehicle_in_range_a_command_fails_at_once() -> None:
    assert isinstance(Scripted().ask("hold").result.exception(0), LinkLostError)


def test_a_pilot_who_takes_over_before_our_thread_has_looked_is_not_overruled() -> None:
    scripted = Scripted()
    scripted.wait(0.2)
    order = scripted.ask("hold")
    scripted.mode = "land"
    scripted.pause(0.8)
    scripted.wait(3.0)
    assert scripted.requests == []
    assert "the mode became land" in str(order.result.exception(0))


def test_a_pilot_who_takes_over_while_an_update_takes_long_is_not_overruled() -> None:
    scripted = Scripted()
    scripted.wait(0.2)
    stalls = [0.6]

    def stall(_: Snapshot) -> None:
        if stalls:
            scripted.mode = "land"
            scripted.ask("hold")
            scripted.clock.now += stalls.pop()

    scripted.loop.on_update = stall
    scripted.wait(3.0)
    assert scripted.requests == []


def test_a_command_that_our_thread_had_no_time_for_is_not_sent_late() -> None:
    scripted = Scripted()
    scripted.wait(0.2)
    order = scripted.ask("hold")
    scripted.pause(UNSENT_COMMAND_S + 0.5)
    scripted.wait(3.0)
    assert scripted.requests == []
    assert "this computer had no time for it" in str(order.result.exception(0))


def test_a_command_of_before_a_reboot_is_not_sent_after_it() -> None:
    scripted = Scripted()
    scripted.wait(0.2)
    order = scripted.ask("arm")
    scripted.reboot()
    scripted.wait(3.0)
    assert scripted.requests == []
    assert "the autopilot has rebooted" in str(order.result.exception(0))


@pytest.mark.parametrize("on_arming", [OnArming.FLIES, OnArming.MAY_FLY])
def test_no_arming_leaves_where_it_starts_a_flight_until_the_mode_is_another_one(
    plain: Plain, on_arming: OnArming
) -> None:
    plain.hear("script", on_arming=on_arming)
    plain.runner.submit(arm_command(is_armed=True), plain.now_s)
    plain.run(1.0, mode="")
    plain.hear("script", on_arming=on_arming)
    assert plain.sent == []
    assert plain.runner.wants_state(plain.now_s)
    plain.hear("manual")
    plain.runner.tick(plain.now_s)
    assert plain.sent == ["arm"]


def test_an_arming_is_not_repeated_where_it_starts_a_flight_by_now(plain: Plain) -> None:
    plain.runner.submit(arm_command(is_armed=True), plain.now_s)
    assert plain.sent == ["arm"]
    for _ in range(40):
        plain.now_s += 0.05
        plain.hear("script", on_arming=OnArming.FLIES)
        plain.runner.tick(plain.now_s)
    assert plain.sent == ["arm"]


def test_a_disarming_leaves_in_any_mode(plain: Plain) -> None:
    plain.hear("script", is_armed=True, on_arming=OnArming.FLIES)
    plain.runner.submit(arm_command(is_armed=False), plain.now_s)
    assert plain.sent == ["disarm"]
