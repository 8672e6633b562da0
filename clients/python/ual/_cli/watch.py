"""``ual watch`` shows the telemetry of one or all UAVs, live on one screen or as lines."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import click

from ual import _discovery
from ual._cli.app import REFUSED, Session, command, note, pass_session
from ual._cli.everyone import ask_all
from ual._cli.output import error_text, pose_text, vector_text
from ual._cli.values import Number
from ual._discovery import Registration
from ual.errors import DaemonUnreachableError, UalError
from ual.types import State, Telemetry

if TYPE_CHECKING:
    from rich.table import Table


_RETRY_S = 1.0
_CLOSE_S = 2.0
_REFRESH_S = 1.0
_LOST_S = 2.0
"""Telemetry that is older than this is shown as lost; at low rates, telemetry that is older than two periods."""
_STATE_STYLES = {
    State.UNINITIALIZED: "red",
    State.FLYING_MANUAL: "yellow",
    State.FLYING_AUTO: "green",
    State.TAKING_OFF: "cyan",
    State.LANDING: "cyan",
}


@command("watch")
@click.option("--all", "everyone", is_flag=True, help="All UAVs of this computer.")
@click.option("--once", is_flag=True, help="Print one sample of each, and end.")
@click.option(
    "--rate",
    "rate_hz",
    type=Number(min=0.0),
    default=5.0,
    show_default=True,
    help="Samples a second; 0 for every sample.",
)
@pass_session
def watch(session: Session, everyone: bool, once: bool, rate_hz: float) -> None:
    """Show the UAV's telemetry until Ctrl-C."""
    if math.isinf(rate_hz):
        raise click.BadParameter("inf is not a rate; use 0 for every sample", param_hint="--rate")
    if everyone:
        daemons = _discovery.list_daemons()
        if not daemons:
            raise DaemonUnreachableError("no daemon runs on this computer: start one with `ual-daemon`")
        if once:
            _print_each(session, daemons)
            return
        with _all_subscribed(session, daemons, rate_hz) as board:
            _follow(session, board)
        return
    with session.connect() as uav:
        if once:
            _print(session, uav.ns, uav.telemetry())
            return
        board = _Board([uav.ns], rate_hz)
        with uav.subscribe(partial(board.put, uav.ns), rate_hz):
            _follow(session, board)


@dataclass(frozen=True, slots=True)
class _Column:
    """What is known of one UAV: its newest sample, when it came, and why no newer one comes, if that is known."""

    since_s: float
    telemetry: Telemetry | None = None
    why: str = ""


class _Board:
    """The newest sample of each UAV. Sets `changed` at every change."""

    def __init__(self, names: Iterable[str], rate_hz: float) -> None:
        self.changed = threading.Event()
        self.lost_after_s = max(_LOST_S, 2.0 / rate_hz if rate_hz else 0.0)
        self._lock = threading.Lock()
        self._columns = {ns: _Column(time.monotonic()) for ns in names}
        self._new: dict[str, Telemetry] = {}

    def put(self, ns: str, telemetry: Telemetry) -> None:
        """Stores a sample."""
        with self._lock:
            self._columns[ns] = _Column(time.monotonic(), telemetry)
            unseen = self._new.get(ns)
            if unseen is not None:  # the unseen sample counts as missed, in addition to those that it had missed
                telemetry = replace(telemetry, missed_count=telemetry.missed_count + unseen.missed_count + 1)
            self._new[ns] = telemetry
        self.changed.set()

    def put_error(self, ns: str, error: UalError) -> None:
        """Stores why no samples come."""
        with self._lock:
            self._columns[ns] = replace(self._columns[ns], why=f"{error.reason}: {error.message}")
        self.changed.set()

    def take(self) -> Mapping[str, Telemetry]:
        """Returns the newest sample of each UAV that has a new one since the last call. Its `missed_count` includes the
        samples that were replaced.
        """
        with self._lock:
            new, self._new = self._new, {}
        return new

    def columns(self) -> Mapping[str, _Column]:
        """Returns what is known of each UAV."""
        with self._lock:
            return dict(self._columns)


@contextmanager
def _all_subscribed(session: Session, daemons: Sequence[Registration], rate_hz: float) -> Iterator[_Board]:
    """Subscribes to all UAVs, each on a thread of its own: one that does not answer does not delay the others."""
    board = _Board([daemon.ns for daemon in daemons], rate_hz)
    is_closing = threading.Event()

    def subscribe(daemon: Registration) -> None:
        is_noted = False
        while not is_closing.is_set():
            try:
                with session.connect_to(daemon) as uav, uav.subscribe(partial(board.put, daemon.ns), rate_hz):
                    is_closing.wait()
            except UalError as error:
                board.put_error(daemon.ns, error)
                if not (is_noted or _is_screen(session)):
                    note(f"ual: {daemon.ns}: {error_text(error)}")
                is_noted = True
                is_closing.wait(_RETRY_S)

    threads = [threading.Thread(target=subscribe, args=(daemon,), daemon=True) for daemon in daemons]
    for thread in threads:
        thread.start()
    try:
        yield board
    finally:
        is_closing.set()
        end_s = time.monotonic() + _CLOSE_S
        for thread in threads:  # a thread that still waits for an answer ends with the process
            thread.join(max(0.0, end_s - time.monotonic()))


def _print_each(session: Session, daemons: Sequence[Registration]) -> None:
    """Prints one sample of each UAV, or why there is none."""
    has_failed = False
    for daemon, found in zip(daemons, ask_all(session, daemons), strict=True):
        if isinstance(found, Telemetry):
            _print(session, daemon.ns, found)
            continue
        has_failed = True
        session.emit({"ns": daemon.ns, "error": found}, f"{daemon.ns}\t{found.reason}")
        note(f"ual: {daemon.ns}: {error_text(found)}")
    if has_failed:
        raise click.exceptions.Exit(REFUSED)


def _is_screen(session: Session) -> bool:
    return sys.stdout.isatty() and not session.as_json


def _follow(session: Session, board: _Board) -> None:
    if _is_screen(session):
        _show(board)
    else:
        _print_lines(session, board)


def _print_lines(session: Session, board: _Board) -> None:
    while True:
        board.changed.wait()
        board.changed.clear()
        for ns, telemetry in board.take().items():
            _print(session, ns, telemetry)
        sys.stdout.flush()


def _print(session: Session, ns: str, telemetry: Telemetry) -> None:
    if session.as_json:
        from ual._cli.output import to_json

        sample = to_json(telemetry)
        assert isinstance(sample, dict)
        session.emit({"ns": ns, **sample})
        return
    parts = [ns, telemetry.state.name]
    if telemetry.pose is not None:
        parts.append(pose_text(telemetry.pose))
    if telemetry.velocity is not None:
        parts.append(f"{telemetry.velocity.linear.norm():.2f} m/s")
    click.echo("\t".join(parts))


def _show(board: _Board) -> None:
    from rich.live import Live

    with Live(screen=True, auto_refresh=False) as live:
        while True:
            live.update(_screen(board.columns(), board.lost_after_s), refresh=True)
            board.changed.wait(_REFRESH_S)  # refreshes also without a change, because the age is shown
            board.changed.clear()


def _screen(found: Mapping[str, _Column], lost_after_s: float) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    table = Table(box=SIMPLE_HEAD, title="ual watch (Ctrl-C ends)", title_justify="left", header_style="bold")
    table.add_column("")
    for ns in sorted(found):
        table.add_column(ns, min_width=24)
    now_s = time.monotonic()
    columns = [_aged_rows(found[ns], now_s - found[ns].since_s, lost_after_s) for ns in sorted(found)]
    for values in zip(*columns, strict=True):
        name = values[0][0]
        table.add_row(name, *(Text(text, style) for _, text, style in values))
    return table


def _aged_rows(column: _Column, age_s: float, lost_after_s: float) -> list[tuple[str, str, str]]:
    """Returns the lines of a column, with the age of the sample if it is old."""
    telemetry = column.telemetry
    (name, state, style), because, *others = _rows(telemetry or Telemetry(State.UNINITIALIZED))
    if telemetry is None:
        others = [(name, "", "") for name, _, _ in others]
    if column.why or age_s >= lost_after_s:
        why = column.why or ("" if telemetry is None else f"it was {state}")
        lost = [(name, f"no telemetry for {age_s:.0f} s", "bold red"), (because[0], why, "red")]
        return lost + [(name, text, "red") for name, text, _ in others]
    if telemetry is None:
        return [(name, "", ""), (because[0], "", ""), *others]
    if age_s >= lost_after_s / 2:
        state = f"{state}, {age_s:.0f} s ago"
    return [(name, state, style), because, *others]


def _rows(t: Telemetry) -> list[tuple[str, str, str]]:
    """Returns name, text and style of each line of one UAV's column."""
    geo, battery, gps, task = t.position_geo, t.battery, t.gps, t.task
    percent = None if battery is None else battery.remaining_percent
    voltage = None if battery is None else battery.voltage_v
    return [
        ("state", t.state.name, _STATE_STYLES.get(t.state, "")),
        ("because", t.state_reason, "dim"),
        ("mode", f"{t.flight_mode}{', armed' if t.armed else ''}", ""),
        ("pose", "" if t.pose is None else pose_text(t.pose), ""),
        ("velocity", "" if t.velocity is None else f"{vector_text(t.velocity.linear)} m/s", ""),
        ("reference", "" if t.reference_pose is None else pose_text(t.reference_pose), ""),
        ("task", "" if task is None else task.description or task.kind.name, ""),
        ("", "" if task is None or task.distance_left_m is None else f"{task.distance_left_m:.2f} m left", ""),
        ("failsafe", "" if t.health is None else t.health.failsafe, "bold red"),
        ("fails", "" if t.health is None else ", ".join(t.health.failing_checks), ""),
        ("battery", " ".join(filter(None, (_known(percent, "{:.0f} %"), _known(voltage, "{:.1f} V")))), ""),
        ("position", "" if geo is None else f"{geo.latitude_deg:.6f} {geo.longitude_deg:.6f}", ""),
        ("satellites", "" if gps is None else f"{gps.satellites_count} ({gps.fix.name})", ""),
        ("autopilot says", t.status_text, "dim"),
    ]


def _known(value: float | None, text: str) -> str:
    return "" if value is None else text.format(value)
