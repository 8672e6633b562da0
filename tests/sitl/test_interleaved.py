"""A mission that is started, paused, jumped and aborted by three threads at once: it stays UAL's own.

While the autopilot flies it, UAL says so, and nobody else is named where only UAL commanded.
"""

from __future__ import annotations

import os
import random
import threading
from collections import Counter
from collections.abc import Callable
from time import monotonic

import pytest

from tests.campaign.starvation import StarvationWatch
from tests.sitl.doing import waypoints
from tests.sitl.flights import Flight
from tests.sitl.simulators import Simulator
from tests.sitl.wiretap import Wiretap
from ual.errors import UalError
from ual.types import State, Telemetry
from ual_daemon import UAL

DURATION_S = float(os.environ.get("UAL_TEST_INTERLEAVED_S", "60"))
"""Seconds for which the threads command."""
pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300 + round(DURATION_S))]

MISSION_MODES = {"PX4": "AUTO.MISSION", "ArduPilot": "AUTO"}
SHORT_S = 1.0
"""Seconds for which a mode and its holder may not fit together."""
OTHERS = ("ground station", "safety pilot")
CHOSEN = ("start", "pause", "resume", "abort", "jump", "start")
SHOWN_S, MOST_SHOWN = 6.0, 3
"""Seconds that are printed before a failsafe, and before some of the times at which the autopilot held by itself."""


class Watch:
    """Looks at each state that is told, and keeps what must not be told for long."""

    def __init__(self, mode: str) -> None:
        self.breaches: list[str] = []
        self.failsafe = ""
        """Failsafe that took the flight, as one of a starved computer: what follows is not judged."""
        self._mode = mode
        self._since_s: float | None = None
        self.lines: list[tuple[float, str]] = []
        """Times at which a mode was reported, and those at which the computer did not run this process."""
        self._told_mode = ""

    def note_starved(self, begun_s: float, ended_s: float) -> None:
        self.lines.append((ended_s, f"starved within {ended_s - begun_s:.2f} s"))

    def on_telemetry(self, told: Telemetry) -> None:
        if told.flight_mode != self._told_mode:
            self._told_mode = told.flight_mode
            self.lines.append((monotonic(), f"{told.flight_mode}, {told.state.name}: {told.state_reason}"))
        if told.health is not None and told.health.failsafe:
            self.failsafe = self.failsafe or told.state_reason
        if self.failsafe:
            return
        wrong = self._wrong(told)
        now_s = monotonic()
        if not wrong:
            self._since_s = None
        elif self._since_s is None:
            self._since_s = now_s
        elif now_s - self._since_s > SHORT_S:
            self._since_s = now_s
            self.breaches.append(wrong)

    def _wrong(self, told: Telemetry) -> str:
        held_by = "" if told.health is None else told.health.held_by
        if held_by in OTHERS or any(each in told.state_reason for each in OTHERS):
            return f"names others: {told.state.name}, {told.flight_mode}: {told.state_reason} ({held_by})"
        if told.flight_mode == self._mode and told.state is State.FLYING_MANUAL:
            return f"its mission is not told as its own: {told.state_reason}"
        return ""


def test_a_mission_stays_ours_whatever_three_threads_command(
    flight: Flight, uav: UAL, simulator: Simulator, wiretap: Wiretap
) -> None:
    flight.take_off()
    uav.mission.upload([*waypoints(flight, 0.5, 0, 0.5, 0)])
    watch = Watch(MISSION_MODES[simulator.autopilot])
    uav.vehicle.subscribe(watch.on_telemetry)
    until_s, done, refused = monotonic() + DURATION_S, Counter[str](), Counter[str]()
    chosen = random.Random(7)
    acts: dict[str, Callable[[], object]] = {
        "start": uav.mission.start,
        "pause": uav.mission.pause,
        "resume": uav.mission.resume,
        "abort": uav.abort,
        "jump": lambda: uav.mission.jump_to(chosen.randint(1, 4)),
        "recover": uav.recover_from_manual,
    }

    def holds_by_itself() -> bool:
        """Returns whether the autopilot does, as after a mission whose last item was jumped to."""
        told = uav.telemetry()
        held_by = "" if told.health is None else told.health.held_by
        return told.state is State.FLYING_MANUAL and told.flight_mode == simulator.own_hold and held_by not in OTHERS

    def command(seed: int) -> None:
        random_of = random.Random(seed)
        while monotonic() < until_s and not watch.failsafe:
            name = "recover" if holds_by_itself() else random_of.choice(CHOSEN)
            try:
                acts[name]()
                done[name] += 1
                watch.lines.append((monotonic(), f"{name} accepted"))
            except UalError as error:
                watch.lines.append((monotonic(), f"{name} refused: {error}"))
                refused[f"{name}: {error.reason}"] += 1
                is_known = "or a failsafe" not in str(error)  # else the cause is not known yet
                if is_known and any(each in str(error) for each in OTHERS):
                    watch.breaches.append(f"{name}: {error}")
            threading.Event().wait(random_of.uniform(0.0, 0.8))  # no two flights have the same moments

    threads = [threading.Thread(target=command, args=(seed,), name=f"commands {seed}") for seed in range(3)]
    starvation = StarvationWatch(os.getpid, watch.note_starved)
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    starvation.close()
    left_s = max(0.0, until_s - monotonic())
    print(f"{simulator.autopilot}: {DURATION_S - left_s:.0f} s: {dict(done)}; refused: {dict(refused)}")
    held = f"{simulator.own_hold}, {State.FLYING_MANUAL.name}"
    for end_s in [time_s for time_s, text in watch.lines if held in text][:MOST_SHOWN]:
        _show(wiretap, watch, end_s)
    if watch.failsafe:
        _show(wiretap, watch, monotonic())
    assert watch.breaches == []
    assert not watch.failsafe
    if holds_by_itself():
        uav.recover_from_manual()
    uav.abort()
    flight.wait_for_state(State.FLYING_AUTO)
    flight.wait_for(lambda: uav.velocity().twist.linear.norm() < 0.5, "its stop", 10.0)


def _show(wiretap: Wiretap, watch: Watch, end_s: float) -> None:
    """Prints what led to a moment."""
    since_s = end_s - SHOWN_S
    lines = sorted(line for line in [*wiretap.timeline(since_s), *watch.lines] if since_s < line[0] < end_s + 1.0)
    print("\n".join([f"{SHOWN_S:.0f} s before:", *(f"{time_s - since_s:5.2f} s: {text}" for time_s, text in lines)]))
