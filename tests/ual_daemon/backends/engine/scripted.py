"""A scripted autopilot at the other end of the engine, on a clock that is moved by hand, and a judge of the rules.

The judge keeps a record of its own of all that was heard, asked for and withdrawn, and knows nothing of how the engine
decides.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Hashable
from concurrent.futures import Future
from dataclasses import dataclass, field, replace

from ual.errors import LinkLostError, UalError
from ual_daemon.backends.engine.command import (
    ARMING,
    FLYING,
    Command,
    Repeat,
    Verdict,
    shows_armed,
    shows_mode,
)
from ual_daemon.backends.engine.command_entrance import CommandEntrance
from ual_daemon.backends.engine.command_runner import CommandRunner
from ual_daemon.backends.engine.limits import BLIND_SILENCE_S, CATCH_UP_S, OWN_MODE_S, SETPOINTS_WAIT_S
from ual_daemon.backends.engine.link_watch import LinkWatch
from ual_daemon.backends.engine.loop import Loop
from ual_daemon.backends.engine.readings import Reading, Readings, Valid
from ual_daemon.backends.values import Control, ControlState, LinkState, Mode, Snapshot

ROUND_S = 0.05
LOST_S = 1.0
MODES = ("manual", "setpoints", "hold", "land")
NEEDED_S = 0.4
TINY = 1e-9

AGAIN = Repeat(0.25, 20)
BRIDGED = Repeat(1.0, 4, after_answer_s=0.3)


def mode_command(mode: str, repeat: Repeat = AGAIN, *, setpoints_before_s: float = 0.0) -> Command[str]:
    """Changes the mode."""
    return Command(
        f"enter {mode}",
        f"mode {mode}",
        FLYING,
        mode=mode,
        shows=shows_mode(mode),
        repeat=repeat,
        setpoints_before_s=setpoints_before_s,
    )


def arm_command(*, is_armed: bool, repeat: Repeat = AGAIN) -> Command[str]:
    """Arms or disarms."""
    what = "arm" if is_armed else "disarm"
    return Command(what, what, ARMING, shows=shows_armed(is_armed=is_armed), repeat=repeat)


COMMANDS: dict[str, Command[str]] = {
    "take control": mode_command("setpoints", setpoints_before_s=NEEDED_S),
    "hold": mode_command("hold"),
    "land": mode_command("land"),
    "land once": mode_command("land", Repeat()),
    "hold through a bridge": mode_command("hold", BRIDGED),
    "arm": arm_command(is_armed=True),
    "disarm": arm_command(is_armed=False),
    "arm through a bridge": arm_command(is_armed=True, repeat=BRIDGED),
    "climb in hold": replace(
        mode_command("hold"), what="climb", then=Command("climb", "climb", FLYING, mode="hold", repeat=AGAIN)
    ),
    "arm in hold": Command(
        "leave the mode, to be armed",
        "mode hold",
        FLYING,
        mode="hold",
        shows=shows_mode("hold"),
        repeat=AGAIN,
        then=arm_command(is_armed=True),
    ),
}


class Clock:
    """Moved by hand."""

    def __init__(self) -> None:
        self.now = 100.0

    def now_s(self) -> float:
        return self.now


@dataclass(eq=False)
class Order:
    """A command that was asked for, as the judge sees it."""

    name: str
    command: Command[str]
    asked_s: float
    mode_seen: str
    own_modes: set[str]
    """Its own, and that of the newest command that was sent a moment before."""
    result: Future[None]
    sent_s: list[float] = field(default_factory=list)
    passed_on_s: float = math.inf
    is_overtaken: bool = False
    is_over: bool = False
    """Whether it was replaced, or the autopilot has booted since."""
    keys: list[Hashable] = field(default_factory=list)


class BrokenRuleError(AssertionError):
    """A command was sent that the rules forbid."""


class Judge:
    """Checks each command that leaves against its own record."""

    def __init__(self) -> None:
        self.orders: list[Order] = []
        self.last_own = ("", -math.inf)
        self.heard_s: list[float] = []
        self.modes: list[tuple[float, str]] = []
        self.armings_s: list[float] = []
        self.discarded_s = -math.inf
        self.blind_until_s = -math.inf
        self.setpoints_since_s = math.inf
        self.is_held_up = False

    def on_message(self, now_s: float) -> None:
        self.heard_s.append(now_s)

    def on_mode(self, mode: str, now_s: float) -> None:
        """A mode was heard: it ends the orders that neither come from it nor lead to it."""
        self.modes.append((now_s, mode))
        for order in self.orders:
            is_judged = order.command.group == FLYING or order.sent_s
            own = order.own_modes if order.command.group == FLYING else order.own_modes | {order.mode_seen}
            if not order.sent_s and self.last_own[1] < now_s:
                own = own | self._own_lately(now_s)  # of a command that left after the asking
            if not is_judged or order.is_over or order.result.done():
                continue
            if order.command.mode and mode == order.command.mode:
                order.mode_seen, order.own_modes = mode, {mode}
            elif order.mode_seen == "":
                order.mode_seen = mode
            elif mode not in {*own, order.mode_seen}:
                order.is_overtaken = True

    def believable_since_s(self) -> float:
        """From when on something said may be relied on: after the last silence, blindness or pause."""
        heard = [-math.inf, *self.heard_s]
        gaps = [later for earlier, later in itertools.pairwise(heard) if later - earlier > BLIND_SILENCE_S]
        return max([*gaps[-1:], self.blind_until_s, self.discarded_s])

    def on_sent(self, request: str, key: Hashable, now_s: float) -> Order:
        """A request leaves. Finds the order, and checks the rules."""
        order = self._order_of(request, key)
        rules = {
            "withdrawn": order.result.cancelled(),
            "ended before": order.result.done(),
            "replaced, or of another boot": order.is_over,
            "over a mode that others chose": order.is_overtaken,
            "into a silence": not self.heard_s or now_s - self.heard_s[-1] > BLIND_SILENCE_S + TINY,
            "while blind": now_s < self.blind_until_s - TINY,
            "executed late": self.is_held_up,
            "before what it changes was heard": self._knows_nothing(order),
            "without setpoints": self._lacks_setpoints(order, now_s),
            "too often": len(order.sent_s) >= order.command.repeat.most,
            "too soon": bool(order.sent_s) and now_s - order.sent_s[-1] < order.command.repeat.every_s - TINY,
            "again without a sign of life": bool(order.sent_s) and self.heard_s[-1] <= order.sent_s[-1],
            "again after a silence": self._may_undo(order),
            "again before the bridge has answered": self._is_bridged_open(order),
        }
        broken = [rule for rule, is_broken in rules.items() if is_broken]
        if broken:
            raise BrokenRuleError(f"{order.name} at {now_s:.2f}: {', '.join(broken)}")
        order.sent_s.append(now_s)
        order.passed_on_s = math.inf
        if order.command.group == FLYING:
            self.last_own = (order.command.mode, now_s)
        elif len(order.sent_s) == 1:
            seen = self.modes[-1][1] if self.modes and self.modes[-1][0] >= self.discarded_s else ""
            order.mode_seen, order.own_modes = seen, self._own_lately(now_s)
        return order

    def on_request(self, name: str, mode_seen: str, result: Future[None], now_s: float) -> Order:
        own = {COMMANDS[name].mode} | self._own_lately(now_s)
        order = Order(name, COMMANDS[name], now_s, mode_seen, own, result)
        self.orders.append(order)
        return order

    def on_taken(self, order: Order, now_s: float) -> None:
        """The loop takes an order: it replaces those of its group, and those of our modes sent meanwhile count."""
        order.own_modes |= self._own_lately(now_s)
        for other in self.orders[: self.orders.index(order)]:
            follows = other.command.then if other.sent_s else None
            has_left_group = follows is not None and follows.group != order.command.group  # it may be done already
            if other.command.group == order.command.group and not has_left_group:
                other.is_over = True

    def on_reboot(self, now_s: float) -> None:
        self.discarded_s = now_s
        for order in self.orders:
            order.is_over = True

    def _own_lately(self, now_s: float) -> set[str]:
        mode, sent_s = self.last_own
        return {mode} if now_s - sent_s < OWN_MODE_S else set()

    def _order_of(self, request: str, key: Hashable) -> Order:
        """Requests end in the number of their order."""
        order = self.orders[int(request.partition("#")[2])]
        if order.keys and key not in order.keys:  # what follows it
            assert order.command.then is not None
            order.command = order.command.then
            order.sent_s, order.passed_on_s = [], math.inf
        order.keys.append(key)
        return order

    def _knows_nothing(self, order: Order) -> bool:
        said_s = [time_s for time_s, _ in self.modes] if order.command.group == FLYING else self.armings_s
        return not said_s or said_s[-1] < self.believable_since_s() - TINY

    def _lacks_setpoints(self, order: Order, now_s: float) -> bool:
        flow_s = now_s - self.setpoints_since_s
        needs_s = order.command.setpoints_before_s
        return flow_s < needs_s - TINY and now_s - order.asked_s < SETPOINTS_WAIT_S - TINY and needs_s > 0.0

    def _may_undo(self, order: Order) -> bool:
        """Returns whether others may have undone it in a silence since it was sent. Out of our own mode it is sent
        again.
        """
        if not order.sent_s or self.believable_since_s() <= order.sent_s[0] + TINY:
            return False
        return order.command.group == ARMING or self.modes[-1][1] != "setpoints"

    def _is_bridged_open(self, order: Order) -> bool:
        after_s = order.command.repeat.after_answer_s
        if after_s is None or not order.sent_s:
            return False
        said_s = [time_s for time_s, _ in self.modes] if order.command.group == FLYING else self.armings_s
        return said_s[-1] < order.passed_on_s + after_s - TINY


def _numbered(command: Command[str], number: int) -> Command[str]:
    then = None if command.then is None else _numbered(command.then, number)
    return replace(command, request=f"{command.request}#{number}", then=then)


class Scripted:
    """The engine with an autopilot that does what a script says."""

    def __init__(self) -> None:
        self.clock = Clock()
        self.judge = Judge()
        self.mode, self.is_armed = "manual", False
        self.boots_count = 1
        self.is_silent = False
        self.says_state = True
        self.unread: list[tuple[str, bool] | None] = []
        """Messages of the autopilot while our thread does not look."""
        self.sent: list[tuple[str, Hashable, Order]] = []
        self.updates: list[Snapshot] = []
        self._broken: BrokenRuleError | None = None
        self.readings = Readings()
        self.read_mode: Reading[Mode] = self.readings.add(Valid.WHILE_HEARD)
        self.read_armed: Reading[bool] = self.readings.add(Valid.WHILE_HEARD)
        self.watch = LinkWatch("script", LOST_S, on_lost=self.readings.discard_state)
        self.runner: CommandRunner[str] = CommandRunner(
            "the script",
            self._transmit,
            lambda now_s: self.snapshot(now_s, now_s, ""),
            self.watch,
            self._setpoints_s,
            hindrance=lambda: "the bridge is late" if self.judge.is_held_up else "",
        )
        self.loop = Loop(self, self.clock, self.watch, self.updates.append)
        self.desk: CommandEntrance[str] = CommandEntrance(self.loop, self.clock, self._require_session)

    # --- What the loop drives ---

    is_urgent = False

    def discard(self, now_s: float, pause_s: float) -> None:
        del pause_s
        self.readings.discard_state()
        self.judge.discarded_s = now_s
        self.unread.clear()

    def tick(self, now_s: float) -> None:
        self.watch.tick(now_s)
        self.runner.tick(now_s)

    def snapshot(self, now_s: float, updated_s: float, scheduling_gap: str) -> Snapshot:
        return Snapshot(
            now_s,
            heard_s=self.watch.heard_s,
            updated_s=updated_s,
            scheduling_gap=scheduling_gap,
            control=ControlState(mode=self.read_mode.sample, armed=self.read_armed.sample),
            link=LinkState(boots_count=self.boots_count),
        )

    # --- The script ---

    def wait(self, duration_s: float) -> None:
        """Rounds of our thread, in which the autopilot says what it does."""
        for _ in range(max(1, round(duration_s / ROUND_S))):
            self.clock.now += ROUND_S
            self._say()
            self.round()

    def pause(self, duration_s: float) -> None:
        """Our thread does not run for so long; what the autopilot says waits."""
        for _ in range(max(1, round(duration_s / ROUND_S))):
            self.clock.now += ROUND_S
            self._say()
        now_s = self.clock.now
        if duration_s > BLIND_SILENCE_S + TINY:
            self.judge.blind_until_s = now_s + CATCH_UP_S
        self.round()

    def ask(self, name: str) -> Order:
        """A caller asks for a command."""
        mode = self.loop.newest.control.mode
        command = _numbered(COMMANDS[name], len(self.judge.orders))
        order: Order | None = None

        def make() -> Command[str]:
            assert order is not None
            self.judge.on_taken(order, self.clock.now)
            return command

        result = self.desk.give(command.what, make)
        order = self.judge.on_request(name, "" if mode is None else mode.value.name, result, self.clock.now)
        return order

    def answer(self, verdict: Verdict, index: int = -1) -> None:
        """The autopilot, or a bridge, answers one of the last requests."""
        if not self.sent:
            return
        _, key, order = self.sent[index % len(self.sent)]
        if verdict is Verdict.PASSED_ON and key is order.keys[-1]:
            order.passed_on_s = min(order.passed_on_s, self.clock.now)
        self.runner.on_answer(key, verdict, self.clock.now, "no")
        self._require_unbroken()

    def obey(self, index: int = -1) -> None:
        """The autopilot executes one of the requests."""
        if not self.sent:
            return
        request = self.sent[index % len(self.sent)][0].partition("#")[0]
        if request.startswith("mode "):
            self.mode = request.removeprefix("mode ")
        elif request != "climb":
            self.is_armed = request == "arm"

    def reboot(self) -> None:
        """The autopilot boots, and our proof of that comes."""
        self.mode, self.is_armed = "manual", False
        self.boots_count += 1
        self.readings.discard_boot()
        self.runner.drop(self.clock.now)
        self.watch.on_reboot(self.clock.now)
        self.judge.on_reboot(self.clock.now)

    def send_setpoints(self, *, flow: bool) -> None:
        """Setpoints begin to flow, or stop."""
        if flow:
            self.judge.setpoints_since_s = min(self.judge.setpoints_since_s, self.clock.now)
        else:
            self.judge.setpoints_since_s = math.inf

    def round(self) -> None:
        """One round of our thread."""
        now_s = self.clock.now
        waiting, self.unread = self.unread, []
        if self.loop.woke(now_s):
            waiting = []
        for said in waiting:
            self._hear(said, now_s)
        self.loop.step(now_s)
        self._require_unbroken()

    def _say(self) -> None:
        if not self.is_silent:
            self.unread.append((self.mode, self.is_armed) if self.says_state else None)

    def _hear(self, said: tuple[str, bool] | None, now_s: float) -> None:
        self.judge.on_message(now_s)
        self.watch.on_message(now_s)
        if said is None:
            return
        mode, is_armed = said
        self.judge.on_mode(mode, now_s)
        self.judge.armings_s.append(now_s)
        self.read_mode.set(Mode(mode, Control.REFERENCES if mode == "setpoints" else Control.OTHER), now_s)
        self.read_armed.set(is_armed, now_s)
        self.runner.on_state(now_s)

    def _transmit(self, request: str, sent_before_count: int, key: Hashable) -> Callable[[], object] | None:
        del sent_before_count
        try:
            order = self.judge.on_sent(request, key, self.clock.now)
        except BrokenRuleError as error:
            self._broken = self._broken or error
            raise
        self.sent.append((request, key, order))
        return None

    def _require_unbroken(self) -> None:
        """Raises what the judge has found: the engine contains what is raised in it."""
        if self._broken is not None:
            raise self._broken

    def _setpoints_s(self, now_s: float) -> float:
        return max(0.0, now_s - self.judge.setpoints_since_s)

    def _require_session(self, what: str) -> CommandRunner[str] | UalError:
        return self.runner if self.watch.is_up(self.clock.now) else LinkLostError(f"cannot {what}: nothing is heard")

    @property
    def requests(self) -> list[str]:
        """Requests sent since the last time."""
        requests = [request.partition("#")[0] for request, _, _ in self.sent]
        self.sent.clear()
        return requests
