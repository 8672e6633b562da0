"""``ual watch``: how one or all UAVs are, live on one screen, or as lines."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import TYPE_CHECKING

import click

from ual import discovery
from ual.cli.app import Session, command, pass_session
from ual.cli.output import pose_text, vector_text
from ual.cli.values import Number
from ual.types import State, Telemetry

if TYPE_CHECKING:
    from rich.table import Table

    from ual.client import Uav

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
    help="Samples a second; 0 is each.",
)
@pass_session
def watch(session: Session, everyone: bool, once: bool, rate_hz: float) -> None:
    """Show how the UAV is, until Ctrl-C."""
    with ExitStack() as stack:
        uavs = [stack.enter_context(uav) for uav in (_all(session) if everyone else [session.connect()])]
        if once:
            for uav in uavs:
                _print(session, uav.ns, uav.telemetry())
        elif session.as_json or not sys.stdout.isatty():
            _print_lines(session, uavs, rate_hz)
        else:
            _show(uavs, rate_hz)


def _all(session: Session) -> list[Uav]:
    from ual.client import Uav

    return [Uav(daemon.ns, address=daemon.address, tls_ca=session.tls_ca) for daemon in discovery.list_daemons()]


class _Board:
    """The newest sample of each UAV; a change wakes whoever waits."""

    def __init__(self) -> None:
        self.changed = threading.Event()
        self._samples: dict[str, Telemetry] = {}

    def put(self, ns: str, telemetry: Telemetry) -> None:
        """Takes a sample."""
        self._samples[ns] = telemetry
        self.changed.set()

    def samples(self) -> Mapping[str, Telemetry]:
        """The samples there are."""
        return dict(self._samples)


@contextmanager
def _subscribed(uavs: list[Uav], rate_hz: float) -> Iterator[_Board]:
    board = _Board()
    with ExitStack() as stack:
        for uav in uavs:
            stack.enter_context(uav.subscribe(partial(board.put, uav.ns), rate_hz))
        yield board


def _print_lines(session: Session, uavs: list[Uav], rate_hz: float) -> None:
    seen: dict[str, int] = {}
    with _subscribed(uavs, rate_hz) as board:
        while True:
            board.changed.wait()
            board.changed.clear()
            for ns, telemetry in board.samples().items():
                if seen.get(ns) != telemetry.sequence:
                    seen[ns] = telemetry.sequence
                    _print(session, ns, telemetry)
            sys.stdout.flush()


def _print(session: Session, ns: str, telemetry: Telemetry) -> None:
    if session.as_json:
        from ual.cli.output import to_json

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


def _show(uavs: list[Uav], rate_hz: float) -> None:
    from rich.live import Live

    with _subscribed(uavs, rate_hz) as board, Live(screen=True, auto_refresh=False) as live:
        while True:
            board.changed.wait()
            board.changed.clear()
            live.update(_screen(board.samples()), refresh=True)


def _screen(samples: Mapping[str, Telemetry]) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    table = Table(box=SIMPLE_HEAD, title="ual watch (Ctrl-C ends)", title_justify="left", header_style="bold")
    table.add_column("")
    for ns in sorted(samples):
        table.add_column(ns, min_width=24)
    columns = [_rows(samples[ns]) for ns in sorted(samples)]
    for values in zip(*columns, strict=True):
        name = values[0][0]
        table.add_row(name, *(Text(text, style) for _, text, style in values))
    return table


def _rows(t: Telemetry) -> list[tuple[str, str, str]]:
    """Name, text and style of each line of one UAV's column."""
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
        ("battery", " ".join(filter(None, (_known(percent, "{:.0f} %"), _known(voltage, "{:.1f} V")))), ""),
        ("position", "" if geo is None else f"{geo.latitude_deg:.6f} {geo.longitude_deg:.6f}", ""),
        ("satellites", "" if gps is None else f"{gps.satellites_count} ({gps.fix.name})", ""),
        ("autopilot says", t.status_text, "dim"),
    ]


def _known(value: float | None, text: str) -> str:
    return "" if value is None else text.format(value)
