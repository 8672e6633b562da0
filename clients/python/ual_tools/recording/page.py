"""Draws a recorded flight on one page (``ual plot``). Needs matplotlib, which is imported only for this."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ual.geometry import Vector3
from ual.recording.reader import Message
from ual.shared import whole_file
from ual.types import State, Telemetry
from ual_tools import positions
from ual_tools.recording.autopilot_log import LogTrack

_SAMPLE_PERIOD_NS = 40_000_000
"""Least time between two drawn points in ns: 25 points a second."""
_SIZE_IN = (11.7, 8.3)
"""A4, landscape."""
_COLOURS = {
    State.UNINITIALIZED: "#999999",
    State.LANDED_DISARMED: "#d9d9d9",
    State.LANDED_ARMED: "#a6cee3",
    State.TAKING_OFF: "#b2df8a",
    State.FLYING_AUTO: "#33a02c",
    State.FLYING_MANUAL: "#ff7f00",
    State.LANDING: "#1f78b4",
}


@dataclass(slots=True)
class Band:
    """Something that lasted: a state or a task, from one time to another, in s."""

    label: str
    begin_s: float
    end_s: float
    state: State | None = None


@dataclass(slots=True)
class DrawnFlight:
    """Drawn data of one UAV; times in s since the beginning of the recording, metres, m/s.

    Its places are in the frame of its telemetry, or in `map` if it is one of several: their own frames differ.
    """

    ns: str
    is_in_map: bool = False
    times_s: list[float] = field(default_factory=list)
    xs: list[float] = field(default_factory=list)
    ys: list[float] = field(default_factory=list)
    heights: list[float] = field(default_factory=list)
    wanted_heights: list[float | None] = field(default_factory=list)
    speeds: list[float] = field(default_factory=list)
    states: list[Band] = field(default_factory=list)
    tasks: list[Band] = field(default_factory=list)
    refusals: list[tuple[float, str]] = field(default_factory=list)
    frame_id: str = ""

    def add(self, message: Message, time_s: float) -> None:
        """Takes what a message says."""
        if message.name == "telemetry":
            self._add_sample(message, time_s)
        elif message.name == "calls":
            call = message.json()
            if call["event"] == "ended" and call["reason"]:
                self.refusals.append((time_s, f"{call['method'].rpartition('/')[2]}: {call['reason']}"))

    def _add_sample(self, message: Message, time_s: float) -> None:
        sample = message.telemetry()
        _extend(self.states, sample.state.name, time_s, sample.state)
        if sample.task is not None:
            _extend(self.tasks, sample.task.kind.name, time_s)
        is_due = not self.times_s or time_s - self.times_s[-1] >= _SAMPLE_PERIOD_NS * 1e-9
        found = _in_map(sample) if self.is_in_map else _in_its_frame(sample)
        if found is None or not is_due:
            return
        self.frame_id = self.frame_id or ("map" if self.is_in_map else sample.frame_id)
        position, reference_z = found
        self.times_s.append(time_s)
        self.xs.append(position.x)
        self.ys.append(position.y)
        self.heights.append(position.z)
        self.wanted_heights.append(reference_z)
        self.speeds.append(0.0 if sample.velocity is None else sample.velocity.linear.norm())


def _in_its_frame(sample: Telemetry) -> tuple[Vector3, float | None] | None:
    """Returns where the UAV is, and at which height its reference; None where that is not known."""
    if sample.pose is None:
        return None
    reference = sample.reference_pose
    return sample.pose.position, None if reference is None else reference.position.z


def _in_map(sample: Telemetry) -> tuple[Vector3, float | None] | None:
    """Returns the same in `map`."""
    measured, reference = positions.position(sample), positions.reference(sample)
    return None if measured is None else (measured, None if reference is None else reference.position.z)


def _extend(bands: list[Band], label: str, time_s: float, state: State | None = None) -> None:
    """Makes the last band longer if it goes on, or begins another one."""
    if bands and bands[-1].label == label and (state is not None or time_s - bands[-1].end_s < 1.0):
        bands[-1].end_s = time_s
        return
    if bands and state is not None:
        bands[-1].end_s = time_s
    bands.append(Band(label, time_s, time_s, state))


def flights(messages: Iterable[Message], *, is_in_map: bool = False) -> list[DrawnFlight]:
    """Returns what is to be drawn of each UAV, in `map` if that is wanted."""
    found: dict[str, DrawnFlight] = {}
    begin_ns: int | None = None
    for message in messages:
        if message.name not in ("telemetry", "calls") or not message.ns:
            continue
        begin_ns = message.log_ns if begin_ns is None else begin_ns
        found.setdefault(message.ns, DrawnFlight(message.ns, is_in_map)).add(
            message, (message.log_ns - begin_ns) * 1e-9
        )
    return [found[ns] for ns in sorted(found)]


def draw(drawn: list[DrawnFlight], file: Path, title: str, log: LogTrack | None = None) -> None:
    """Draws the page: ground track, height, speed, states, tasks and refusals. The ending of the name says the format.

    A `log` is drawn beside them: the track in the autopilot's log of the same flight.

    Raises:
        OSError: The file cannot be written.

    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title)
    axes = figure.subplot_mosaic(
        [["track", "height"], ["track", "speed"], ["bands", "bands"]],
        height_ratios=[2, 2, 1 + 0.5 * len(drawn)],
        width_ratios=[2, 3],
    )
    for flight in drawn:
        [line] = axes["track"].plot(flight.xs, flight.ys, label=flight.ns, linewidth=1.0)
        if flight.xs:
            axes["track"].plot(flight.xs[0], flight.ys[0], "o", color=line.get_color(), markersize=5)
        axes["height"].plot(flight.times_s, flight.heights, color=line.get_color(), label=flight.ns)
        wanted = [float("nan") if height is None else height for height in flight.wanted_heights]
        axes["height"].plot(flight.times_s, wanted, "--", color=line.get_color(), linewidth=0.8, alpha=0.7)
        axes["speed"].plot(flight.times_s, flight.speeds, color=line.get_color())
    if log is not None:
        axes["track"].plot(log.xs, log.ys, "k:", linewidth=0.8, label="the autopilot's log")
        axes["height"].plot(log.times_s, log.heights, "k:", linewidth=0.8)
        axes["speed"].plot(log.times_s, log.speeds, "k:", linewidth=0.8)
    frame = drawn[0].frame_id
    axes["track"].set(xlabel=f"x (m), in {frame}", ylabel="y (m)", title="ground track")
    axes["track"].set_aspect("equal", adjustable="datalim")
    axes["track"].legend()
    axes["height"].set(ylabel="z (m)", title="height (dashed: the reference)")
    axes["speed"].set(ylabel="speed (m/s)", xlabel="time (s)")
    for name in ("track", "height", "speed"):
        axes[name].grid(alpha=0.3)
    _draw_bands(axes["bands"], drawn)
    axes["speed"].sharex(axes["height"])
    axes["bands"].set_xlim(axes["height"].get_xlim())
    with whole_file.writing(file) as part:
        figure.savefig(part, dpi=120)


def _draw_bands(axes: Any, drawn: list[DrawnFlight]) -> None:  # noqa: ANN401  matplotlib has no types
    """Draws states, tasks and refusals of each UAV in three rows, over the time."""
    from matplotlib.patches import Patch

    labels: list[str] = []
    used: dict[State, None] = {}
    for flight in drawn:
        for row, bands in (("state", flight.states), ("tasks", flight.tasks)):
            y = -len(labels)
            labels.append(f"{flight.ns} {row}")
            for band in bands:
                colour = "#fdbf6f" if band.state is None else _COLOURS[band.state]
                axes.barh(y, band.end_s - band.begin_s, 0.8, left=band.begin_s, color=colour, edgecolor="white")
                if band.state is None:
                    axes.text(band.begin_s, y, f" {band.label.lower()}", va="center", fontsize=6, clip_on=True)
                else:
                    used[band.state] = None
        y = -len(labels)
        labels.append(f"{flight.ns} refusals")
        for time_s, text in flight.refusals:
            axes.plot(time_s, y, "x", color="#e31a1c", markersize=6)
            axes.text(time_s, y, f"  {text}", va="center", fontsize=6, clip_on=True)
    axes.set_yticks([-index for index in range(len(labels))], labels, fontsize=7)
    axes.set_xlabel("time (s)")
    patches = [Patch(color=_COLOURS[state], label=state.name) for state in used]
    axes.legend(handles=patches, fontsize=6, ncols=len(patches) or 1, loc="upper center", bbox_to_anchor=(0.5, -0.25))
