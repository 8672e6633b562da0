"""The table of `ual watch --all`: one line for each UAV, as many columns as fit, and the part that is scrolled to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from ual._cli.keys import Key
from ual._cli.output import running_text
from ual._cli.watch_board import Seen
from ual.types import State, Telemetry

STATE_STYLES = {
    State.UNINITIALIZED: "red",
    State.FLYING_MANUAL: "yellow",
    State.FLYING_AUTO: "green",
    State.TAKING_OFF: "cyan",
    State.LANDING: "cyan",
}
_HEAD_LINES = 2
_GAP = "  "
_MOST_OF_NAME = 24
_LEAST_OF_NOTE = 12


@dataclass(frozen=True, slots=True)
class Line:
    """One line of the screen: its text, not longer than the screen is wide, and its style (of rich)."""

    text: str
    style: str = ""


@dataclass(frozen=True, slots=True)
class _Column:
    title: str
    width: int
    cell: Callable[[Telemetry], str]


def _percent(t: Telemetry) -> str:
    percent = None if t.battery is None else t.battery.remaining_percent
    return "" if percent is None else f"{percent:.0f} %"


# Shown in this order. On a narrow screen the last ones are left out.
_COLUMNS = (
    _Column("state", 15, lambda t: t.state.name),
    _Column("x y z (m)", 21, lambda t: "" if t.pose is None else " ".join(f"{c:6.1f}" for c in t.pose.position)),
    _Column("m/s", 4, lambda t: "" if t.velocity is None else f"{t.velocity.linear.norm():4.1f}"),
    _Column("battery", 7, _percent),
    _Column("mode", 12, lambda t: t.flight_mode),
    _Column("armed", 5, lambda t: "armed" if t.armed else ""),
)


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
    return max(1, height - _HEAD_LINES)


def table(
    seen: Mapping[str, Seen], *, width: int, height: int, top: int, now_s: float, lost_after_s: float
) -> list[Line]:
    """Returns the lines of the screen: `height` at most, and each `width` characters at most."""
    names = list(seen)
    name_width = min(_MOST_OF_NAME, max(3, width // 3), max([3, *map(len, names)]))
    columns = _fitting(width - name_width)
    used = name_width + sum(len(_GAP) + column.width for column in columns)
    note_width = max(0, width - used - len(_GAP))
    note_width = note_width if note_width >= _LEAST_OF_NOTE else 0
    shown = names[top : top + page_size(height)]
    lines = [
        Line(_clip(_title(len(names), top, len(shown), width), width), "bold"),
        Line(_head(columns, name_width, note_width)[:width], "bold underline"),
    ]
    for ns in shown:
        name = _clip(ns, name_width).ljust(name_width)
        rest, style = _rest(seen[ns], columns, note_width, width - name_width - len(_GAP), now_s, lost_after_s)
        lines.append(Line(f"{name}{_GAP}{rest}".rstrip()[:width], style))
    return lines[:height]


def _fitting(width: int) -> list[_Column]:
    fitting = []
    for column in _COLUMNS:
        if len(_GAP) + column.width > width:
            break
        width -= len(_GAP) + column.width
        fitting.append(column)
    return fitting


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
    note = ["task, reason".ljust(note_width)] if note_width else []
    return _GAP.join(["uav".ljust(name_width), *titles, *note])


def _rest(
    seen: Seen, columns: Sequence[_Column], note_width: int, width: int, now_s: float, lost_after_s: float
) -> tuple[str, str]:
    """Returns what stands behind the name, and the style of the line."""
    what = problem(seen, now_s, lost_after_s)
    telemetry = seen.telemetry
    if what:
        return _clip(what, width), "red"
    if telemetry is None:
        return "", ""
    cells = [_clip(column.cell(telemetry), column.width).ljust(column.width) for column in columns]
    note = [_clip(_note(telemetry), note_width)] if note_width else []
    return _GAP.join([*cells, *note]), STATE_STYLES.get(telemetry.state, "")


def problem(seen: Seen, now_s: float, lost_after_s: float) -> str:
    """Returns why the sample must not be taken for the present, or nothing."""
    was = "" if seen.telemetry is None else f", it was {seen.telemetry.state.name}"
    if seen.gone_s is not None:
        return f"its daemon has ended{was}"
    age_s = now_s - seen.since_s
    if seen.why:
        return f"no telemetry for {age_s:.0f} s{was}: {' '.join(seen.why.split())}"
    return f"no telemetry for {age_s:.0f} s{was}" if age_s >= lost_after_s else ""


def _note(t: Telemetry) -> str:
    if t.task is None:
        return t.state_reason
    left = "" if t.task.distance_left_m is None else f", {t.task.distance_left_m:.1f} m left"
    return f"{running_text(t.task)}{left}"


def _clip(text: str, width: int) -> str:
    return text if len(text) <= width else f"{text[: max(0, width - 1)]}…"[:width]
