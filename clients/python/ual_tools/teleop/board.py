"""The screen of `ual teleop`: what the UAV does, what the sticks do, and the keys."""

from __future__ import annotations

import math
from collections.abc import Container, Sequence
from textwrap import wrap

from ual.types import State, Telemetry
from ual_tools import condition
from ual_tools.condition import STYLES
from ual_tools.output import pose_text, running_text
from ual_tools.teleop.pilot import TELEMETRY_AGE_LIMIT_S, StickMode, View
from ual_tools.teleop.speeds import LEVELS
from ual_tools.watch_table import STATE_STYLES, TableRow

_NAME_COLUMNS = 11
_MOST_LINES = 3
"""Of a long text."""
_REFUSAL_SHOWN_S = 3.0
"""A refusal is bright for this time."""


def screen_rows(
    view: View, title: str, help_text: Sequence[tuple[str, str]], question: str, *, width: int, height: int
) -> list[TableRow]:
    """Returns the lines of the screen: `height` at most, each `width` characters at most."""
    which = f" ({view.number} of {view.count}, Tab)" if view.count > 1 else ""
    head = [TableRow(f"ual teleop {title}: {view.name}{which}", "bold")]
    for most_lines, names in ((_MOST_LINES, _ALL), (1, _ALL), (1, _FEW), (1, _FEWEST)):
        uav = _named(_uav(view), names, most_lines, width)
        sticks = _named(_sticks(view, question), names, most_lines, width)
        for keys in (_keys(help_text, width), _folded(help_text, width)):
            gap = height - len(head) - len(uav) - len(sticks) - len(keys)
            if gap >= 0 and all(len(line.text) <= width for line in keys):
                blanks = [TableRow("")] * 2 if gap >= 2 else [TableRow("")] * 0
                parts = (*head, *uav, *blanks[:1], *sticks, *blanks[1:], *keys)
                return [TableRow(line.text[:width], line.style) for line in parts]
    parts = (*head, *uav, *sticks, *_folded(help_text, width))
    return [TableRow(line.text[:width], line.style) for line in parts[:height]]


_Row = tuple[str, str, str]
_ALL: Container[str] | None = None
_FEW = ("state", "position", "battery", "telemetry", "flies", "done", "refused")
"""Rows on a small screen, so that there is room for the keys."""
_FEWEST = ("state", "done", "refused")


def _named(rows: Sequence[_Row], names: Container[str] | None, most_lines: int, width: int) -> list[TableRow]:
    """Returns the rows of some names as lines, each text in so many at most."""
    chosen = [row for row in rows if names is None or row[0] in names]
    return [line for name, text, style in chosen for line in _row(name, text, style, width, most_lines)]


def _uav(view: View) -> list[_Row]:
    t = view.telemetry or Telemetry(State.UNINITIALIZED)
    is_old = view.age_s > TELEMETRY_AGE_LIMIT_S
    level = condition.battery_level(t.battery)
    rows = [
        ("state", "" if view.telemetry is None else t.state.name, STATE_STYLES.get(t.state, "")),
        ("because", t.state_reason, "dim"),
        ("mode", f"{t.flight_mode}{', armed' if t.armed else ''}", ""),
        ("position", "" if t.pose is None else f"{pose_text(t.pose)}  in {t.frame_id}", ""),
        ("speed", _speed(t), ""),
        ("battery", _battery(t), STYLES[level]),
        ("task", "" if t.task is None else running_text(t.task), ""),
        ("telemetry", _age(view), ""),
    ]
    return [(name, text, "red" if is_old else style) for name, text, style in rows]


def _speed(t: Telemetry) -> str:
    if t.velocity is None:
        return ""
    v = t.velocity.linear
    return f"{v.norm():.2f} m/s ({v.horizontal_norm():.2f} horizontal, {v.z:+.2f} up)"


def _battery(t: Telemetry) -> str:
    if t.battery is None:
        return ""
    voltage = None if t.battery.remaining_percent is None else t.battery.voltage_v
    return f"{condition.battery_text(t.battery)}{'' if voltage is None else f' {voltage:.1f} V'}"


def _age(view: View) -> str:
    if view.age_s <= TELEMETRY_AGE_LIMIT_S:
        return f"{view.age_s:.1f} s old"
    return f"NONE FOR {view.age_s:.0f} s: the sticks do nothing"


def _sticks(view: View, question: str) -> list[_Row]:
    s = view.sticks
    is_fresh = view.refusal.text and view.now_s - view.refusal.time_s < _REFUSAL_SHOWN_S
    deflections = f"forward {s.forward:+.2f}   left {s.left:+.2f}   up {s.up:+.2f}   turn {s.turn:+.2f}"
    return [
        ("flies", _meaning(view), "bold"),
        ("sticks", deflections, "" if s.is_centred() else "bold green"),
        ("done", question or view.done.text, "bold yellow" if question else ""),
        ("refused", _refused(view), "bold red" if is_fresh else "dim"),
    ]


def _meaning(view: View) -> str:
    axes = "east and north" if view.is_headless else "the nose"
    speeds = view.speeds
    what = f"steps of {speeds.step_m:g} m, {speeds.turn_step_deg:g}°"
    if view.mode is StickMode.VELOCITY:
        what = f"{speeds.horizontal_m_s:g} m/s, up {speeds.vertical_m_s:g} m/s, {speeds.turn_deg_s:.0f}°/s"
    return f"{view.mode.value} along {axes}, level {view.level + 1} of {len(LEVELS)}: {what}"


def _refused(view: View) -> str:
    if not view.refusal.text:
        return ""
    return f"{view.refusal.text} ({max(0.0, view.now_s - view.refusal.time_s):.0f} s ago)"


def _row(name: str, text: str, style: str, width: int, most_lines: int) -> list[TableRow]:
    """Returns a row, which goes on in further lines if the text is long."""
    first, *others = wrap(text, max(8, width - _NAME_COLUMNS), max_lines=most_lines, placeholder=" …") or [""]
    return [
        TableRow(f"{name:<{_NAME_COLUMNS}}{first}", style),
        *(TableRow(f"{'':<{_NAME_COLUMNS}}{each}", style) for each in others),
    ]


def _keys(help_text: Sequence[tuple[str, str]], width: int) -> list[TableRow]:
    """Returns the keys in two columns, the first half of them on the left."""
    cells = [f"{keys:<9} {text}" for keys, text in help_text]
    half = math.ceil(len(cells) / 2)
    left, right = cells[:half], [*cells[half:], ""]
    column = max([width // 2, *(len(cell) + 2 for cell in left)])
    return [TableRow(f"{a:<{column}}{b}".rstrip(), "dim") for a, b in zip(left, right, strict=False)]


def _folded(help_text: Sequence[tuple[str, str]], width: int) -> list[TableRow]:
    """Returns the keys one after the other, where two columns have no room."""
    text = "; ".join(f"{' '.join(keys.split())}: {what}" for keys, what in help_text)
    return [TableRow(line, "dim") for line in wrap(text, max(8, width))]
