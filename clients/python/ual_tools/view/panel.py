"""The words of the panel, as Markdown: what is known of one UAV, and all UAVs as a list. Pure; draws nothing."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ual.types import Telemetry
from ual_tools import watch_screen
from ual_tools.view.shown import Shown, clock_text
from ual_tools.watch_board import WatchedUav

_SPECIAL = re.compile(r"([\\`*_{}\[\]<>()#+!|~&$:-])")

_CURTAIN_STYLE = """<style>
@keyframes ual-curtain { to { visibility: visible; } }
.ual-curtain { visibility: hidden; animation: ual-curtain 0s 2s forwards; position: fixed; inset: 0; z-index: 10000;
  pointer-events: none; background: rgba(110, 110, 110, 0.55); backdrop-filter: grayscale(1); }
.ual-curtain b { position: fixed; top: 40%; left: 5%; padding: 1em; background: #d62728; color: white; }
</style>"""


def plain(text: str) -> str:
    """Returns a text of which Markdown makes nothing but itself. It may come from an autopilot or a daemon."""
    return _SPECIAL.sub(r"\\\1", " ".join(text.split()))


def head(utc_s: float, count: int) -> str:
    """Returns the line that says of which moment the page is."""
    return f"**{count} UAV{'' if count == 1 else 's'}** as of **{clock_text(utc_s)}**"


def curtain(utc_s: float) -> str:
    """Returns what greys the whole page, as HTML, 2 s after it came, unless a newer one replaces it.

    It is the browser that counts: the page may be old because `ual view` hangs, or because nothing gets through.
    """
    text = f"NO NEWS since {clock_text(utc_s)}: this is not the present"
    return f"{_CURTAIN_STYLE}<div class='ual-curtain'><b>{text}</b></div>"


def details(uav: Shown, watched: WatchedUav, *, now_s: float, carried: Sequence[tuple[str, str]] = ()) -> str:
    """Returns all that is known of a UAV. Of one that is lost it says so first, and nothing stands as the present.

    `carried` has a line for each thing that it carries. A UAV that is lost has none: what it was is no more known.
    """
    telemetry, age = watched.telemetry, f"telemetry {now_s - watched.since_s:.1f} s old, pose {uav.age_s:.1f} s old"
    if telemetry is None:
        return f"### {plain(uav.label)}"
    share = None if telemetry.health is None else telemetry.health.link_quality
    quality = "" if share is None else f"; {100.0 * share:.0f} % of the autopilot's messages arrive"
    lines = [*_rows(telemetry), ("link", age + quality)]
    if uav.is_lost:
        return f"### {plain(uav.label)}\n\nWhat was known then ({uav.age_s:.1f} s old):\n\n{_table(lines)}"
    return f"### {plain(uav.ns)}: {plain(telemetry.state.name)}\n\n{_table([*lines, *carried])}"


def log(lines: Sequence[str]) -> str:
    """Returns the lines of the log."""
    return "\n".join(f"- {plain(line)}" for line in lines)


def _table(lines: Sequence[tuple[str, str]]) -> str:
    rows = [f"| {plain(name)} | {plain(text)} |" for name, text in lines if text]
    return "\n".join(["| | |", "|---|---|", *rows])


def _rows(t: Telemetry) -> list[tuple[str, str]]:
    """Returns the lines of `ual watch`, and what an operator looks for besides."""
    found = [(name, text) for name, text, _ in watch_screen.rows(t) if name != "state"]
    if t.task is not None and t.task.progress is not None:
        found.append(("progress", f"{100.0 * t.task.progress:.0f} % after {t.task.elapsed_s:.0f} s"))
    if t.health is not None:
        found += [
            ("failsafe", t.health.failsafe),
            ("held by", t.health.held_by),
            ("checks that fail", "; ".join(t.health.failing_checks)),
        ]
    return [*found, ("frame lost", t.frame_lost)]
