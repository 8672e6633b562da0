"""The table of `ual watch --all`: one line for each UAV, the worst first, as many columns as fit, and the part that is
scrolled to.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from ual.types import State, Telemetry
from ual_tools import condition, positions
from ual_tools.condition import STYLES, UavCondition, Urgency
from ual_tools.keys import Key
from ual_tools.output import running_text
from ual_tools.watch_board import WatchedUav

STATE_STYLES = {
    State.UNINITIALIZED: "red",
    State.FLYING_MANUAL: "yellow",
    State.FLYING_AUTO: "green",
    State.TAKING_OFF: "cyan",
    State.LANDING: "cyan",
}
_HEAD_LINES, _SHORT_HEAD_LINES = 3, 2
_SHORT_SCREEN_LINES = 8
"""A screen of fewer lines shows no counts."""
_GAP = "  "
_MOST_NAME_COLUMNS = 24
_LEAST_OF_NOTE, _AMPLE_OF_NOTE = 12, 40


@dataclass(frozen=True, slots=True)
class TableRow:
    """One line of the screen: its text, not longer than the screen is wide, and its style (of rich)."""

    text: str
    style: str = ""


@dataclass(frozen=True, slots=True)
class _Column:
    title: str
    width: int
    cell: Callable[[Telemetry], str]


def _position_text(t: Telemetry) -> str:
    position = positions.position(t)
    return "" if position is None else " ".join(f"{c:6.1f}" for c in position)


# Shown in this order. On a narrow screen the last ones are left out.
_COLUMNS = (
    _Column("state", 15, lambda t: t.state.name),
    _Column("battery", 13, lambda t: condition.battery_text(t.battery)),
    _Column("x y z (m) in map", 21, _position_text),
    _Column("m/s", 4, lambda t: "" if t.velocity is None else f"{t.velocity.linear.norm():4.1f}"),
)
_MORE_COLUMNS = (
    _Column("mode", 12, lambda t: t.flight_mode),
    _Column("armed", 5, lambda t: "armed" if t.armed else ""),
)
"""Shown besides where the note has ample room, too."""
_NOTE_TITLES = ("what is wrong, task", "wrong, task")
_OF_TROUBLE = _COLUMNS[:2]
"""Columns that stay where the note about a UAV needs the room of the others."""


def scrolled(top: int, keys: Sequence[Key], count: int, height: int) -> int:
    """Returns the number of the first UAV that is shown after some keys, of `count` on a screen of `height` lines."""
    page = page_size(height)
    last_top = max(0, count - page)
    for key in keys:
        steps = {Key.UP: -1, Key.DOWN: 1, Key.PAGE_UP: -page, Key.PAGE_DOWN: page, Key.HOME: -count, Key.END: count}
        top = min(last_top, max(0, top + steps.get(key, 0)))
    return min(last_top, max(0, top))


def page_size(height: int) -> int:
    """Returns how many UAVs a screen shows."""
    return max(1, height - (_SHORT_HEAD_LINES if height < _SHORT_SCREEN_LINES else _HEAD_LINES))


def table(
    watched: Mapping[str, WatchedUav], *, width: int, height: int, top: int, now_s: float, lost_after_s: float
) -> list[TableRow]:
    """Returns the lines of the screen: `height` at most, and each `width` characters at most."""
    conditions = {ns: condition.uav_condition(each, now_s, lost_after_s) for ns, each in watched.items()}
    names = condition.worst_first(watched, conditions.__getitem__, str)
    name_width = min(_MOST_NAME_COLUMNS, max(3, width // 3), max([3, *map(len, names)]))
    columns = _fitting(width - name_width)
    note_width = _note_width(width - name_width, columns)
    shown = names[top : top + page_size(height)]
    lines = [TableRow(_clip(_title(len(names), top, len(shown), width), width), "bold")]
    if height >= _SHORT_SCREEN_LINES:
        counts = condition.summary(conditions.values())
        lines.append(TableRow(_clip(counts, width), STYLES[condition.worst(conditions.values())]))
    lines.append(TableRow(_head(columns, name_width, note_width)[:width], "bold underline"))
    for ns in shown:
        name = _clip(ns, name_width).ljust(name_width)
        rest = _rest(watched[ns], conditions[ns], columns, note_width, width - name_width - len(_GAP))
        lines.append(TableRow(f"{name}{_GAP}{rest}".rstrip()[:width], _style(watched[ns], conditions[ns])))
    return lines[:height]


def _fitting(width: int) -> list[_Column]:
    """Returns the columns that fit: the last ones only where the note has ample room beside them."""
    fitting: list[_Column] = []
    for column in _COLUMNS:
        if len(_GAP) + column.width > width:
            return fitting
        width -= len(_GAP) + column.width
        fitting.append(column)
    needed = sum(len(_GAP) + column.width for column in _MORE_COLUMNS)
    return [*fitting, *_MORE_COLUMNS] if width >= needed + len(_GAP) + _AMPLE_OF_NOTE else fitting


def _note_width(width: int, columns: Sequence[_Column]) -> int:
    left = width - sum(len(_GAP) + column.width for column in columns) - len(_GAP)
    return left if left >= _LEAST_OF_NOTE else 0


def _title(count: int, top: int, shown: int, width: int) -> str:
    which = f"{count} UAV{'s' if count != 1 else ''}" if shown == count else f"{top + 1}-{top + shown} of {count} UAVs"
    texts = (
        f"ual watch: {which}   arrows, PgUp, PgDn, Home, End scroll; q quits",
        f"{which}   arrows scroll, q quits",
        f"{which}  q quits",
    )
    return next((text for text in texts if len(text) <= width), which)


def _head(columns: Sequence[_Column], name_width: int, note_width: int) -> str:
    titles = [column.title.ljust(column.width) for column in columns]
    note = (
        [next((each for each in _NOTE_TITLES if len(each) <= note_width), "").ljust(note_width)] if note_width else []
    )
    return _GAP.join(["uav".ljust(name_width), *titles, *note])


def _rest(watched: WatchedUav, how: UavCondition, columns: Sequence[_Column], note_width: int, width: int) -> str:
    """Returns what stands behind the name."""
    telemetry = watched.telemetry
    if telemetry is None or how.state == "LOST":
        return _clip(how.text, width)
    note = how.note or _note(telemetry)
    if how.note and len(how.note) > note_width:
        columns = [column for column in columns if column in _OF_TROUBLE]
        note_width = _note_width(width + len(_GAP), columns)
    cells = [_clip(column.cell(telemetry), column.width).ljust(column.width) for column in columns]
    return _GAP.join([*cells, *([_clip(note, note_width)] if note_width else [])])


def _style(watched: WatchedUav, how: UavCondition) -> str:
    if how.level is not Urgency.FINE or watched.telemetry is None:
        return STYLES[how.level]
    return STATE_STYLES.get(watched.telemetry.state, "")


def _note(t: Telemetry) -> str:
    if t.task is None:
        return t.state_reason
    left = "" if t.task.distance_left_m is None else f", {t.task.distance_left_m:.1f} m left"
    return f"{running_text(t.task)}{left}"


def _clip(text: str, width: int) -> str:
    return text if len(text) <= width else f"{text[: max(0, width - 1)]}…"[:width]
