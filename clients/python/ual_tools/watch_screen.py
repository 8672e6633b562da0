"""The screen of `ual watch`: a table of all UAVs, or all that is known of one. Drawn with rich."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

from ual.types import GpsInfo, State, Telemetry
from ual_tools import condition, positions, watch_table
from ual_tools.condition import STYLES
from ual_tools.keys import Key
from ual_tools.output import pose_text, running_text, vector_text
from ual_tools.terminal import keyboard
from ual_tools.watch_board import Board, WatchedUav

if TYPE_CHECKING:
    from rich.console import RenderableType

_REFRESH_S = 1.0
"""The screen is drawn this often also without a change, because it shows ages."""
_POLL_S = 0.1
"""The screen is drawn at most this often, except when a key is pressed."""


class ScreenPicture(Protocol):
    """Content of the screen."""

    def press(self, keys: Sequence[Key], count: int, height: int) -> None:
        """Takes the keys that were pressed."""

    def draw(self, board: Board, width: int, height: int) -> RenderableType:
        """Returns what the screen shows now."""


def show(board: Board, picture: ScreenPicture) -> None:
    """Shows a picture of the board until q or Ctrl-C. Leaves the terminal as it was."""
    from rich.console import Console
    from rich.live import Live

    console = Console()
    with keyboard() as keys, Live(console=console, screen=True, auto_refresh=False) as live:
        drawn_s = 0.0
        pressed: Sequence[Key] = []
        while Key.QUIT not in pressed:
            picture.press(pressed, len(board.watched_uavs()), console.size.height)
            if pressed or board.changed.is_set() or time.monotonic() - drawn_s >= _REFRESH_S:
                board.changed.clear()
                live.update(picture.draw(board, console.size.width, console.size.height), refresh=True)
                drawn_s = time.monotonic()
            pressed = keys.wait(_POLL_S)


class FleetTable:
    """All UAVs, one line each."""

    def __init__(self) -> None:
        self._top = 0

    def press(self, keys: Sequence[Key], count: int, height: int) -> None:
        """Scrolls. Also without a key: the screen may be larger now, or a UAV may be gone."""
        self._top = watch_table.scrolled(self._top, keys, count, height)

    def draw(self, board: Board, width: int, height: int) -> RenderableType:
        """Returns the lines."""
        lines = watch_table.table(
            board.watched_uavs(),
            width=width,
            height=height,
            top=self._top,
            now_s=time.monotonic(),
            lost_after_s=board.lost_after_s,
        )
        return as_text(lines)


class Detail:
    """All that is known of one UAV."""

    def press(self, keys: Sequence[Key], count: int, height: int) -> None:
        """Takes no keys."""

    def draw(self, board: Board, width: int, height: int) -> RenderableType:
        """Returns the lines, each with its name."""
        return as_text(
            detail(board.watched_uavs(), width=width, now_s=time.monotonic(), lost_after_s=board.lost_after_s)
        )


def as_text(lines: Sequence[watch_table.TableRow]) -> RenderableType:
    """Converts lines to what rich draws."""
    from rich.console import Group
    from rich.text import Text

    return Group(*(Text(line.text, line.style, no_wrap=True, overflow="crop") for line in lines))


def detail(
    found: Mapping[str, WatchedUav], *, width: int, now_s: float, lost_after_s: float
) -> list[watch_table.TableRow]:
    """Returns the lines of one UAV, none wider than the screen: a long text goes on in the next line."""
    from textwrap import wrap

    lines = [watch_table.TableRow("ual watch (q quits)"[:width], "bold")]
    for ns, watched in found.items():
        lines.append(watch_table.TableRow(ns[:width], "bold underline"))
        for name, text, style in _aged_rows(watched, now_s - watched.since_s, lost_after_s):
            first, *others = wrap(text, max(8, width - 15)) or [""]
            lines.append(watch_table.TableRow(f"{name:<13}  {first}"[:width], style))
            lines += [watch_table.TableRow(f"{'':<13}  {each}"[:width], style) for each in others]
    return lines


def _aged_rows(watched: WatchedUav, age_s: float, lost_after_s: float) -> list[tuple[str, str, str]]:
    """Returns the lines of a UAV, with the age of the sample if it is old."""
    telemetry = watched.telemetry
    (name, state, style), because, *others = rows(telemetry or Telemetry(State.UNINITIALIZED))
    if telemetry is None:
        others = [(name, "", "") for name, _, _ in others]
    if watched.why or age_s >= lost_after_s:
        why = watched.why or ("" if telemetry is None else f"it was {state}")
        lost = [(name, f"no telemetry for {age_s:.0f} s", "bold red"), (because[0], why, "red")]
        return lost + [(name, text, "red") for name, text, _ in others]
    if telemetry is None:
        return [(name, "", ""), (because[0], "", ""), *others]
    if age_s >= lost_after_s / 2:
        state = f"{state}, {age_s:.0f} s ago"
    return [(name, state, style), because, *others]


def rows(t: Telemetry) -> list[tuple[str, str, str]]:
    """Returns name, text and style of each line about one UAV."""
    geo, battery, gps, task = t.position_geo, t.battery, t.gps, t.task
    level = condition.battery_level(battery)
    voltage = None if battery is None or battery.remaining_percent is None else battery.voltage_v
    return [
        ("state", t.state.name, watch_table.STATE_STYLES.get(t.state, "")),
        ("because", t.state_reason, "dim"),
        ("mode", f"{t.flight_mode}{', armed' if t.armed else ''}", ""),
        ("pose", "" if t.pose is None else pose_text(t.pose), ""),
        ("in map", "" if (position := positions.position(t)) is None else vector_text(position), ""),
        ("velocity", "" if t.velocity is None else f"{vector_text(t.velocity.linear)} m/s", ""),
        ("reference", "" if t.reference_pose is None else pose_text(t.reference_pose), ""),
        ("task", "" if task is None else running_text(task), ""),
        ("", "" if task is None or task.distance_left_m is None else f"{task.distance_left_m:.2f} m left", ""),
        ("battery", " ".join((condition.batteries_text(t), _known(voltage, "{:.1f} V"))).strip(), STYLES[level]),
        ("position", "" if geo is None else f"{geo.latitude_deg:.6f} {geo.longitude_deg:.6f}", ""),
        ("satellites", "" if gps is None else f"{gps.satellites_count or '?'} ({gps.fix.name})", ""),
        ("corrections", "" if gps is None else _corrections(gps), ""),
        ("autopilot says", t.status_text, "dim"),
    ]


def _corrections(gps: GpsInfo) -> str:
    parts = _known(gps.corrections_age_s, "{:.1f} s old"), _known(gps.baseline_m, "{:.0f} m away")
    return ", ".join(filter(None, parts))


def _known(value: float | None, text: str) -> str:
    return "" if value is None else text.format(value)
