"""Draws box plots of the latencies, as in the paper's Figure 3, and bars of the other measures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks.effort import SUBSCRIBERS
from benchmarks.results import Results
from benchmarks.setups import SETPOINT_WAYS, TELEMETRY_WAYS

_OURS, _THEIRS = "#3b76af", "#c9c9c9"
_WHISKERS = (1, 99)


def write(results: Results, directory: Path) -> list[Path]:
    """Writes all plots for which there are values. Returns their files."""
    import matplotlib as mpl

    mpl.use("svg")
    mpl.rcParams["svg.hashsalt"] = "ual"  # the same values then make the same file
    from matplotlib import pyplot as plt

    directory.mkdir(parents=True, exist_ok=True)
    files = []
    plots = {
        "setpoints": (1, [("setpoint_ms", "from the call to the vehicle, ms", [way.name for way in SETPOINT_WAYS])]),
        "telemetry": (
            len(SUBSCRIBERS),
            [
                (f"telemetry_ms_{count}", f"{count} subscriber(s), ms", [way.name for way in TELEMETRY_WAYS])
                for count in SUBSCRIBERS
            ],
        ),
    }
    for name, (columns, boxes) in plots.items():
        figure, axes = plt.subplots(1, columns, figsize=(8, 3.6), squeeze=False, layout="constrained")
        for axis, (measure, label, ways) in zip(axes[0], boxes, strict=True):
            _boxes(axis, results, measure, label, ways)
        files.append(_save(figure, directory / f"{name}.svg"))
    figure, axes = plt.subplots(1, 2, figsize=(8, 3.0), layout="constrained")
    _bars(axes[0], results, "setpoints_per_s", "setpoints/s that arrive", is_log=True)
    _bars(axes[1], results, "server_percent", "server at 50 Hz + PX4 stream, % of a core")
    files.append(_save(figure, directory / "rates.svg"))
    return files


def _boxes(axis, results: Results, measure: str, label: str, ways: Sequence[str]) -> None:  # type: ignore[no-untyped-def]  # noqa: ANN001 (matplotlib's)
    shown = [way for way in reversed(ways) if results.has(measure, way)]
    axis.set_xlabel(label)
    if not shown:
        return
    boxes = axis.boxplot(
        [results.all(measure, way) for way in shown],
        orientation="horizontal",
        tick_labels=shown,
        whis=_WHISKERS,
        showfliers=False,
        patch_artist=True,
        medianprops={"color": "black"},
    )
    for way, patch in zip(shown, boxes["boxes"], strict=True):
        patch.set_facecolor(_color(way))
    axis.set_xscale("log")
    axis.grid(axis="x", which="both", alpha=0.3)


def _bars(axis, results: Results, measure: str, label: str, *, is_log: bool = False) -> None:  # type: ignore[no-untyped-def]  # noqa: ANN001 (matplotlib's)
    ways = [way for way in reversed(results.values.get(measure, {})) if results.has(measure, way)]
    spreads = [results.spread(measure, way) for way in ways]
    medians = [spread.median for spread in spreads]
    errors = [
        [spread.median - spread.least for spread in spreads],
        [spread.most - spread.median for spread in spreads],
    ]
    axis.barh(ways, medians, xerr=errors, color=[_color(way) for way in ways], capsize=3)
    if is_log:
        axis.set_xscale("log")
    axis.set_xlabel(label)
    axis.grid(axis="x", alpha=0.3)


def _color(way: str) -> str:
    return _OURS if way.startswith("UAL") else _THEIRS


def _save(figure, file: Path) -> Path:  # type: ignore[no-untyped-def]  # noqa: ANN001 (matplotlib's)
    from matplotlib import pyplot as plt

    figure.savefig(file, metadata={"Date": None})
    plt.close(figure)
    return file
