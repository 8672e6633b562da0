"""Draws the plots of the tracker's benchmark with matplotlib, as SVG."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.tracker import light
from benchmarks.tracker.methods import FAR, OURS, PURSUIT
from benchmarks.tracker.tracked import TrackedFlight

_COLORS = {OURS: "#3b76af", FAR: "#c44e52", PURSUIT: "#8c8c8c"}


def flights(file: Path, title: str, found: Mapping[str, Sequence[TrackedFlight]]) -> Path:
    """Draws each flight: its distance from the line over the distance flown, and the distance flown over time."""
    figure, (off, along) = _figure(2)
    for way, flown in found.items():
        for number, each in enumerate(flown):
            label = way if number == 0 else None
            ways_m, off_m = each.along_and_off_m()
            times_s = [place.time_s - each.places[0].time_s for place in each.places]
            off.plot(ways_m, off_m, color=_COLORS[way], alpha=0.6, linewidth=1.0, label=label)
            along.plot(times_s, ways_m, color=_COLORS[way], alpha=0.6, linewidth=1.0, label=label)
            end_m = (each.goal - each.start).norm()
    for axis, reached in ((off, off.axvline), (along, along.axhline)):
        reached(end_m, color="black", linewidth=0.6, linestyle=":")
        axis.grid(alpha=0.3)
    off.set(xlabel="way along the line, m", ylabel="off the line, m", title=title)
    along.set(xlabel="time since the command, s", ylabel="way along the line, m")
    along.legend(loc="lower right")
    return _save(figure, file)


def zigzags(file: Path, found: Mapping[str, light.Zigzag]) -> Path:
    """Draws the first corners from above, and the distance of the whole flight from the rounded path."""
    figure, (above, off) = _figure(2)
    for way, each in found.items():
        shown = [p for p in each.flown if p.x <= 2.5 * light.LEG_M and p.y <= 2.5 * light.LEG_M]
        above.plot([p.x for p in shown], [p.y for p in shown], color=_COLORS[way], label=way)
        off.plot([i * light.STEP_S for i in range(len(each.off_m))], each.off_m, color=_COLORS[way], linewidth=0.8)
        corners = each.corners[:6]
    above.plot([p.x for p in corners], [p.y for p in corners], ":", color="black", linewidth=0.8)
    above.set(xlabel="x, m", ylabel="y, m", aspect="equal", title=f"{light.ZIGZAG_M_S:g} m/s, the first corners")
    off.set(xlabel="time, s", ylabel="off the rounded path, m", title=f"all {light.CORNERS} corners")
    above.legend()
    return _save(figure, file)


def goals(file: Path, found: light.ChangingGoals) -> Path:
    """Draws the setpoints that were sent while the goal changed, as shares of the limits."""
    figure, axes = _figure(len(found.shares))
    for axis, (name, shares) in zip(axes, found.shares.items(), strict=True):
        axis.plot(found.times_s, shares, ".", markersize=1.5, color=_COLORS[OURS], rasterized=True)
        axis.axhline(1.0, color="black", linewidth=0.6)
        axis.set(xlabel="time, s", ylabel="of its limit", title=name)
    return _save(figure, file)


def _figure(columns: int) -> tuple[Any, Any]:
    import matplotlib as mpl

    mpl.use("svg")
    mpl.rcParams["svg.hashsalt"] = "ual"  # the same values then make the same file
    from matplotlib import pyplot as plt

    return plt.subplots(1, columns, figsize=(11, 4), layout="constrained")


def _save(figure: Any, file: Path) -> Path:  # noqa: ANN401  matplotlib has no types
    from matplotlib import pyplot as plt

    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, metadata={"Date": None})
    plt.close(figure)
    return file
