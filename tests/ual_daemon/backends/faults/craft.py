"""A simulated vehicle with all of UAL above its backend, and a script of faults in the vehicle's own time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from enum import Enum, auto
from typing import ClassVar, NamedTuple

from tests.waiting import until
from ual.errors import UalError
from ual.types import Limits, State
from ual_daemon import UAL
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.state import estimate

LIMITS = Limits()
_POLL_S = 0.002

Action = Callable[[], object]
Script = Sequence[tuple[float, Action]]
"""Actions by their time, in seconds after the beginning."""


class Can(Enum):
    """A fault that a simulator can show."""

    BE_UNHEARD = auto()
    """Nothing is heard of the vehicle, and it hears all that is sent."""
    BE_FLOWN_BY_A_PILOT = auto()
    REBOOT = auto()
    IGNORE = auto()
    """It obeys no command, and answers none."""
    REFUSE = auto()
    STALL = auto()
    """The thread of the backend can be kept from running, while the vehicle flies on."""
    REPEAT = auto()
    """Its backend repeats commands that are not answered, as nothing between it and the vehicle executes them late."""
    BE_HELD_UP = auto()
    """Messages wait on our side of the link."""


class ObservedState(NamedTuple):
    """Observations of a simulator: its time, the times at which setpoints have reached it, and the commands; see
    `Craft`.
    """

    now_s: Callable[[], float]
    setpoints_s: Callable[[], list[float]]
    commands: Callable[[], list[tuple[float, str]]]


class Craft(ABC):
    """One vehicle that flies. Its time is its own, so that a slow computer delays a test, and changes nothing.

    A script is played by the thread that steps the vehicle, so that what it does happens at its moment, whatever the
    computer does.
    """

    can: ClassVar[frozenset[Can]]
    link_s: ClassVar[float] = 2.0
    """A link without a word is lost by then."""
    seen_s: ClassVar[float] = 0.7
    """A take-over shows in the state by then."""

    def __init__(self, backend: Backend, seen: ObservedState) -> None:
        self.backend = backend
        self.seen = seen
        self.uav = UAL(backend, allow_arming=True)
        self.states: list[tuple[float, State]] = []
        """Each change of the state that the data show by themselves, with its time: no slow test can miss one."""
        self.snapshots: list[Snapshot] = []
        self.errors: list[UalError] = []
        """Errors that the commands of scripts have raised."""
        self._script: list[tuple[float, Action]] = []
        self._stall_s = 0.0
        self.uav.vehicle.subscribe(lambda _: self._on_telemetry())

    def close(self) -> None:
        self.uav.close()

    # --- What each simulator has -----------------------------------------------------------------------------------

    @property
    def now_s(self) -> float:
        """The vehicle's time since the simulation has begun."""
        return self.seen.now_s()

    def setpoints_s(self) -> list[float]:
        """Returns the times at which setpoints have reached the vehicle."""
        return self.seen.setpoints_s()

    def commands(self) -> list[tuple[float, str]]:
        """The commands that arm, disarm, or change the control, which have reached the vehicle, with their times."""
        return self.seen.commands()

    @abstractmethod
    def advance(self) -> None:
        """Lets the vehicle fly on by a step."""

    def pass_step(self) -> None:
        """Lets it fly on by a step while the backend's thread waits, which is the one that calls this."""
        self.step_script()
        self.advance()

    def ready(self) -> None:
        """Lets it become ready to arm."""
        self.until(self.uav.is_ready)

    def be_silent(self, *, does: bool) -> None:
        raise NotImplementedError

    def fall_silent(self) -> None:
        self.be_silent(does=True)

    def speak(self) -> None:
        self.be_silent(does=False)

    def pilot_takes_over(self) -> None:
        raise NotImplementedError

    def pilot_disarms(self) -> None:
        raise NotImplementedError

    def reboot(self) -> None:
        raise NotImplementedError

    def ignore(self, *, does: bool = True) -> None:
        raise NotImplementedError

    def refuse(self, text: str) -> None:
        raise NotImplementedError

    def hold_up(self, *, does: bool = True) -> None:
        raise NotImplementedError

    # --- Scripts ---------------------------------------------------------------------------------------------------

    def play(self, *script: tuple[float, Action], for_s: float) -> float:
        """Plays a script, and waits until it has ended and its time has passed. Returns when it began."""
        began: list[float] = []
        ended: list[float] = []

        def begin() -> None:
            began.append(self.now_s)
            self.later(*script, (for_s, lambda: ended.append(self.now_s)))

        self._script.append((0.0, begin))
        self.until(lambda: ended)
        return began[0]

    def later(self, *script: tuple[float, Action]) -> None:
        """Adds to what is played. To be called by an action."""
        self._script += [(self.now_s + after_s, action) for after_s, action in script]

    def run(self, duration_s: float) -> float:
        """Lets time pass. Returns when it began."""
        return self.play(for_s=duration_s)

    def step_script(self) -> None:
        """Does what is due. Each simulator calls this before each step of its vehicle."""
        while due := [each for each in self._script if each[0] <= self.now_s]:
            self._script.remove(due[0])
            try:
                due[0][1]()
            except UalError as error:
                self.errors.append(error)

    def until(self, condition: Action) -> None:
        """Waits for a condition."""
        until(condition, seen=lambda: (self.uav.telemetry(), self.commands()[-5:]))

    def until_state(self, *states: State) -> None:
        self.until(lambda: self.uav.state() in states)

    def stall(self, duration_s: float) -> None:
        """Keeps the backend's thread from running for so long, from its next update on."""
        self._stall_s = duration_s

    def _on_telemetry(self) -> None:
        snapshot = self.backend.snapshot()
        state = estimate(snapshot, self.backend.freshness).state
        if not self.states or self.states[-1][1] is not state:
            self.states.append((self.now_s, state))
        duration_s, self._stall_s = self._stall_s, 0.0
        end_s = self.now_s + duration_s
        while self.now_s < end_s - 1e-6:
            self.pass_step()

    # --- What has happened -----------------------------------------------------------------------------------------

    def setpoints_between(self, begin_s: float, end_s: float = float("inf")) -> list[float]:
        return [each for each in list(self.setpoints_s()) if begin_s < each <= end_s]

    def commands_since(self, begin_s: float, end_s: float = float("inf")) -> list[str]:
        return [name for time_s, name in list(self.commands()) if begin_s <= time_s < end_s]

    def first_s(self, state: State, since_s: float) -> float:
        """Returns the time at which the data first showed a state, at or after a time; infinite if they have not."""
        return next((time_s for time_s, seen in list(self.states) if time_s >= since_s and seen is state), float("inf"))

    # --- Flights ---------------------------------------------------------------------------------------------------

    def arm(self) -> None:
        self.ready()
        if self.uav.state() is State.LANDED_DISARMED:
            self.uav.arm()

    def fly(self) -> None:
        """Takes off."""
        self.arm()
        self.uav.take_off(self.height_m)

    height_m: ClassVar[float] = 2.0

    def command(self, name: str) -> Future[None]:
        """Gives the backend a command, as the layers above do."""
        backend = self.backend
        commands: dict[str, Callable[[], Future[None]]] = {
            "arm": backend.arm,
            "disarm": backend.disarm,
            "take_off": lambda: backend.take_off(self.height_m, LIMITS),
            "land": lambda: backend.land(LIMITS),
            "take_control": backend.take_control,
            "hold": backend.hold,
        }
        return commands[name]()
