"""Condition of a UAV: how urgent its problems are, and their text. By it all tables are sorted. Pure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import TypeVar

from ual.discovery import natural_order
from ual.errors import UalError
from ual.types import Battery, Health, State, Telemetry
from ual_tools.watch_board import WatchedUav

LOW_PERCENT, CRITICAL_PERCENT = 30.0, 15.0
"""At and below these a battery is called low (QGroundControl announces it from there on), and critical (PX4 warns
from there on, when not configured)."""
_ALWAYS_REPORTED = ("daemon: ", "autopilot: ", "position: ")
"""Prefixes of checks that are reported in each state; see `ual.types.Health`."""
_WEAK_LINK_SHARE = 0.8
"""Share of the autopilot's messages below which the link counts as weak."""

T = TypeVar("T")


class Urgency(IntEnum):
    """Urgency of a condition."""

    FINE = 0
    WARNING = 1
    ALARM = 2


STYLES: Mapping[Urgency, str] = {Urgency.FINE: "", Urgency.WARNING: "bold yellow", Urgency.ALARM: "bold red"}
"""Of rich."""


@dataclass(frozen=True, slots=True)
class UavCondition:
    """Condition of a UAV.

    `state` is its state in one word, ``LOST`` where nothing true is known of it. `text` says all that is wrong, and
    `note` the same without the battery, where that is shown beside it.
    """

    level: Urgency = Urgency.FINE
    state: str = ""
    text: str = ""
    note: str = ""

    @property
    def is_lost(self) -> bool:
        """Whether nothing true is known of its state."""
        return self.level is Urgency.ALARM and self.state not in State.__members__


def of_telemetry(t: Telemetry) -> UavCondition:
    """Returns how a UAV is by a sample that is the present."""
    found = [*_of_health(t), *_of_state(t)]
    battery = battery_level(t.battery)
    others = sorted(found, key=lambda each: -each[0])
    note = "; ".join(text for _, text in others)
    if battery is not Urgency.FINE:
        others = sorted([*found, (battery, f"battery {battery_text(t.battery)}")], key=lambda each: -each[0])
    text = "; ".join(text for _, text in others)
    return UavCondition(max((level for level, _ in others), default=Urgency.FINE), t.state.name, text, note)


def uav_condition(watched: WatchedUav, now_s: float, lost_after_s: float) -> UavCondition:
    """Returns how a UAV is by what is known of it."""
    what = problem(watched, now_s, lost_after_s)
    if what:
        return UavCondition(Urgency.ALARM, "LOST", what, what)
    return UavCondition() if watched.telemetry is None else of_telemetry(watched.telemetry)


def of_answer(found: Telemetry | UalError) -> UavCondition:
    """Returns how a UAV is by what its daemon answered."""
    if isinstance(found, Telemetry):
        return of_telemetry(found)
    text = " ".join(found.message.split())
    return UavCondition(Urgency.ALARM, found.reason, text, text)


def problem(watched: WatchedUav, now_s: float, lost_after_s: float) -> str:
    """Returns why the sample must not be taken for the present, or nothing."""
    was = "" if watched.telemetry is None else f", it was {watched.telemetry.state.name}"
    if watched.gone_s is not None:
        return f"its daemon has ended{was}"
    age_s = now_s - watched.since_s
    if watched.why:
        return f"no telemetry for {age_s:.0f} s{was}: {' '.join(watched.why.split())}"
    return f"no telemetry for {age_s:.0f} s{was}" if age_s >= lost_after_s else ""


def battery_text(battery: Battery | None) -> str:
    """Returns how full a battery is, and in words if it is too empty; its voltage where no more is known."""
    if battery is None:
        return ""
    if battery.remaining_percent is None:
        return "" if battery.voltage_v is None else f"{battery.voltage_v:.1f} V"
    text = {Urgency.WARNING: " LOW", Urgency.ALARM: " CRITICAL"}.get(battery_level(battery), "")
    return f"{battery.remaining_percent:.0f} %{text}"


def batteries_text(t: Telemetry) -> str:
    """Returns how full the battery is that the flight depends on, and of several how full each is."""
    decisive = battery_text(t.battery)
    if len(t.batteries) < 2:
        return decisive
    each = (" ".join(filter(None, (str(b.id), b.function, battery_text(b) or "?"))) for b in t.batteries)
    return f"{decisive} ({', '.join(each)})"


def battery_level(battery: Battery | None) -> Urgency:
    """Returns how urgent it is that a battery is charged; what is not known is no trouble."""
    percent = None if battery is None else battery.remaining_percent
    if percent is None or percent > LOW_PERCENT:
        return Urgency.FINE
    return Urgency.ALARM if percent <= CRITICAL_PERCENT else Urgency.WARNING


def worst_first(found: Iterable[T], condition_of: Callable[[T], UavCondition], name_of: Callable[[T], str]) -> list[T]:
    """Returns UAVs sorted by urgency, those that are lost before all others, then by name and number."""

    def rank(each: T) -> tuple[int, bool, object]:
        how = condition_of(each)
        return -how.level, not how.is_lost, natural_order(name_of(each))

    return sorted(found, key=rank)


def summary(conditions: Iterable[UavCondition]) -> str:
    """Returns how many UAVs need attention, and how many are in which state, what is worst first."""
    known = list(conditions)
    level_of: dict[str, Urgency] = {}
    for each in known:
        level_of[each.state] = max(each.level, level_of.get(each.state, Urgency.FINE))
    levels = Counter(each.level for each in known)
    alarms, warnings = levels[Urgency.ALARM], levels[Urgency.WARNING]
    urgent = [f"{alarms} alarm{'s' * (alarms > 1)}"] * bool(alarms)
    urgent += [f"{warnings} warning{'s' * (warnings > 1)}"] * bool(warnings)
    counts = Counter(each.state or "not heard yet" for each in known)
    states = sorted(counts, key=lambda state: (-level_of.get(state, Urgency.FINE), -counts[state], state))
    return "; ".join(filter(None, (", ".join(urgent), ", ".join(f"{counts[state]} {state}" for state in states))))


def worst(conditions: Iterable[UavCondition]) -> Urgency:
    """Returns the most urgent level."""
    return max((each.level for each in conditions), default=Urgency.FINE)


def _of_health(t: Telemetry) -> list[tuple[Urgency, str]]:
    health = t.health or Health()
    found = [(Urgency.ALARM, f"failsafe: {health.failsafe}")] * bool(health.failsafe)
    if t.frame_lost:
        found.append((Urgency.ALARM, f"frame lost: {t.frame_lost}"))
    if health.link_quality is not None and health.link_quality < _WEAK_LINK_SHARE:
        found.append((Urgency.WARNING, f"weak link: {100.0 * health.link_quality:.0f} % arrives"))
    found += [(Urgency.WARNING, each) for each in health.failing_checks if each.startswith(_ALWAYS_REPORTED)]
    if t.state is State.LANDED_DISARMED and health.is_ready_to_arm is False:
        others = ", ".join(each for each in health.failing_checks if not each.startswith(_ALWAYS_REPORTED))
        found.append((Urgency.WARNING, f"not ready to arm: {others or 'it does not say why'}"))
    return found


def _of_state(t: Telemetry) -> list[tuple[Urgency, str]]:
    if t.state is State.UNINITIALIZED:
        return [(Urgency.ALARM, t.state_reason or "nothing can be done yet")]
    if t.state is State.FLYING_MANUAL:
        held_by = "" if t.health is None else t.health.held_by
        return [(Urgency.WARNING, f"held by {held_by}" if held_by else t.state_reason or "flown by hand")]
    return []
