"""All UAVs of a page as a table in HTML, the worst first. Pure; draws nothing."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from html import escape

from ual_tools import condition
from ual_tools.condition import Urgency
from ual_tools.view.palette import css
from ual_tools.view.shown import Shown

NAME_ATTRIBUTE = "data-ual-ns"
"""Of a line: a click on it chooses the UAV (`shell`)."""
MARK_ATTRIBUTE = "data-ual-mark"
"""Of what chooses its UAV beside those that are chosen already."""
TITLE_ATTRIBUTE = "data-ual-title"
"""Of the table: what the page's title says."""
_CLASSES = {Urgency.FINE: "", Urgency.WARNING: "ual-warning", Urgency.ALARM: "ual-alarm"}
_STYLE = """<style>
.ual-fleet { max-height: 34vh; overflow: auto; font-size: 0.8em; margin: 0.5em 0.8em; }
.ual-fleet table { border-collapse: collapse; width: 100%; }
.ual-fleet td, .ual-fleet th { padding: 0.15em 0.35em; text-align: left; vertical-align: top; }
.ual-fleet th { position: sticky; top: 0; background: white; }
.ual-fleet tr[data-ual-ns] { cursor: pointer; }
.ual-fleet tr.ual-chosen td { border-top: 1px solid #228be6; border-bottom: 1px solid #228be6; }
.ual-fleet tr.ual-alarm { background: #fbdcdc; color: #a00000; font-weight: 600; }
.ual-fleet tr.ual-warning { background: #fff1c9; color: #6b4a00; }
.ual-fleet i { display: inline-block; width: 1.3em; height: 1.3em; border-radius: 0.2em; color: white;
  text-align: center; line-height: 1.3em; font-style: normal; }
.ual-fleet small { display: block; font-weight: 400; }
.ual-counts { margin: 0.5em 0.8em 0; font-size: 0.9em; }
.ual-counts.ual-alarm { color: #a00000; font-weight: 700; }
.ual-counts.ual-warning { color: #6b4a00; font-weight: 600; }
</style>"""


def table(uavs: Iterable[Shown], chosen: Collection[str], title: str) -> str:
    """Returns the table. A line that is clicked on chooses its UAV."""
    known = condition.worst_first(uavs, lambda uav: uav.how, lambda uav: uav.ns)
    counts = condition.summary(uav.how for uav in known) or "no UAV yet"
    worst = condition.worst(uav.how for uav in known)
    rows = "".join(_row(uav, is_chosen=uav.ns in chosen) for uav in known)
    head = "<tr><th></th><th>UAV</th><th>state</th><th>battery</th><th>task</th></tr>"
    return (
        f"{_STYLE}<div class='ual-counts {_CLASSES[worst]}' {TITLE_ATTRIBUTE}='{escape(title)}'>{escape(counts)}</div>"
        f"<div class='ual-fleet'><table>{head}{rows}</table></div>"
    )


def with_alarms(title: str, uavs: Iterable[Shown]) -> str:
    """Returns the title of the page, with how many UAVs need attention in front."""
    known = [uav.how for uav in uavs]
    if condition.worst(known) is Urgency.FINE:
        return title
    return f"{condition.summary(known).partition(';')[0]} - {title}"


def _row(uav: Shown, *, is_chosen: bool) -> str:
    classes = " ".join(filter(None, (_CLASSES[uav.how.level], "ual-chosen" * is_chosen)))
    mark = f"<i style='background:{css(uav.mark)}'>{'&#10003;' if is_chosen else ''}</i>"
    wrong = f"<small>{escape(uav.how.note)}</small>" if uav.how.note else ""
    cells = (escape(uav.ns), escape(uav.how.state or "not heard yet"), escape(uav.battery))
    what = f"<td>{escape(uav.task)}{wrong}</td>"
    row = "".join(f"<td>{cell}</td>" for cell in cells)
    return f"<tr class='{classes}' {NAME_ATTRIBUTE}='{escape(uav.ns)}'><td {MARK_ATTRIBUTE}>{mark}</td>{row}{what}</tr>"
