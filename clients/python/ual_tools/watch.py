"""``ual watch`` shows the telemetry of one or all UAVs, live on one screen or as lines."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import click

from ual.discovery import Registration
from ual.errors import UalError
from ual.types import Telemetry
from ual_tools import condition, positions
from ual_tools.app import Multi, command
from ual_tools.help import Section
from ual_tools.output import error_text, pose_text, vector_text
from ual_tools.selection import ask_all, several
from ual_tools.session import REFUSED_STATUS, CommandSession, note, pass_session
from ual_tools.values import Number
from ual_tools.watch_board import Board
from ual_tools.watch_roster import all_subscribed

if TYPE_CHECKING:
    from ual_tools.network.joined import Joined

_TELEMETRY_RATE_HZ = 5.0
_TOTAL_RATE_HZ = 200.0
"""Of all UAVs together. With 200 UAVs at 5 Hz, one program could not read all samples in time."""


@command(
    "watch",
    "ual watch",
    "ual watch --all",
    "ual watch --network",
    "ual --json watch --rate 1",
    section=Section.LOOKING,
    multi=Multi.ITSELF,
)
@click.option("--once", is_flag=True, help="Print one sample of each, and end.")
@click.option(
    "--rate",
    "rate_hz",
    type=Number(min=0.0),
    help="Samples a second of each UAV; 0 for every sample. 5 when not given, fewer for more than 40 UAVs.",
)
@pass_session
def watch(session: CommandSession, once: bool, rate_hz: float | None) -> None:
    """Show the UAV's telemetry until q or Ctrl-C.

    With --all it is a table with one line for each UAV of this computer, with --ns uav_1,uav_2 for each of these. The
    worst comes first, in red where it is urgent. Positions are in map. The arrow keys, PgUp, PgDn, Home and End scroll
    it. UAVs appear when their daemons start, and vanish when they end. In a pipe, or with --json, each sample is one
    line.
    With --network and without names it shows what all UAVs of the network tell, at their own rate; those that are gone
    stay, with since when.
    """
    if rate_hz is not None and math.isinf(rate_hz):
        raise click.BadParameter("inf is not a rate; use 0 for every sample", param_hint="--rate")
    if session.joined is not None and session.ns is None:
        _watch_network(session, session.joined, once=once, rate_hz=rate_hz)
        return
    daemons = several(session)
    if daemons is not None:
        if once:
            _print_each(session, daemons)
            return
        rate_hz = default_rate_hz(len(daemons)) if rate_hz is None else rate_hz
        board = Board([daemon.ns for daemon in daemons], rate_hz)
        with all_subscribed(session, board, rate_hz, is_quiet=_is_screen(session)):
            _follow(session, board, is_all=True)
        return
    with session.connect() as uav:
        if once:
            _print(session, uav.ns, uav.telemetry(), is_one=True)
            return
        rate_hz = default_rate_hz(1) if rate_hz is None else rate_hz
        board = Board([uav.ns], rate_hz)
        with uav.subscribe(partial(board.put, uav.ns), rate_hz):
            _follow(session, board, is_all=False)


def _watch_network(session: CommandSession, joined: Joined, *, once: bool, rate_hz: float | None) -> None:
    """Shows what all UAVs of the network tell."""
    from ual.network.roster import KEEP_GONE_S
    from ual_tools.network.feed import Feed, feeding
    from ual_tools.network.joined import label

    if rate_hz is not None:
        raise click.BadParameter("the network tells at its own rate; name UAVs by --ns", param_hint="--rate")
    network = joined.network()
    if once:
        here = [uav for uav in network.uavs() if uav.gone_s is None]
        for uav in condition.worst_first(here, lambda each: condition.of_telemetry(each.telemetry), label):
            _print(session, label(uav), uav.telemetry, is_one=False)
        return
    board = Board([], 1.0, KEEP_GONE_S)
    with feeding(Feed(network, board, (lambda _: None) if _is_screen(session) else note)):
        _follow(session, board, is_all=True)


def default_rate_hz(count: int) -> float:
    """Returns how many samples a second are asked of each of some UAVs: as many as one program can read."""
    return min(_TELEMETRY_RATE_HZ, _TOTAL_RATE_HZ / count)


def _print_each(session: CommandSession, daemons: Sequence[Registration]) -> None:
    """Prints one sample of each UAV, or why there is none; the worst first."""
    answers = [(daemon.ns, found) for daemon, found in zip(daemons, ask_all(session, daemons), strict=True)]
    for ns, found in condition.worst_first(answers, lambda each: _condition(each[1]), lambda each: each[0]):
        if isinstance(found, Telemetry):
            _print(session, ns, found, is_one=False)
            continue
        session.emit({"ns": ns, "error": found}, f"{ns}\t{found.reason}")
        note(f"ual: {ns}: {error_text(found)}")
    if not all(isinstance(found, Telemetry) for _, found in answers):
        raise click.exceptions.Exit(REFUSED_STATUS)


def _condition(found: Telemetry | UalError) -> condition.UavCondition:
    if isinstance(found, Telemetry):
        return condition.of_telemetry(found)
    return condition.UavCondition(condition.Urgency.ALARM)


def _is_screen(session: CommandSession) -> bool:
    return sys.stdout.isatty() and not session.as_json


def _follow(session: CommandSession, board: Board, *, is_all: bool) -> None:
    if _is_screen(session):
        from ual_tools import watch_screen

        watch_screen.show(board, watch_screen.FleetTable() if is_all else watch_screen.Detail())
    else:
        _print_rows(session, board, is_one=not is_all)


def _print_rows(session: CommandSession, board: Board, *, is_one: bool) -> None:
    while True:
        board.changed.wait()
        board.changed.clear()
        for ns, telemetry in board.take().items():
            _print(session, ns, telemetry, is_one=is_one)
        sys.stdout.flush()


def _print(session: CommandSession, ns: str, telemetry: Telemetry, *, is_one: bool) -> None:
    """Prints a sample as one line: of several UAVs with its place in `map`, which they share."""
    if session.as_json:
        from ual_tools.output import to_json

        sample = to_json(telemetry)
        assert isinstance(sample, dict)
        session.emit({"ns": ns, **sample})
        return
    how = condition.of_telemetry(telemetry)
    speed = "" if telemetry.velocity is None else f"{telemetry.velocity.linear.norm():.2f} m/s"
    where = _pose(telemetry) if is_one else _position_text(telemetry)
    parts = [ns, telemetry.state.name, where, speed, condition.battery_text(telemetry.battery), how.note]
    click.echo("\t".join(parts).rstrip("\t"))


def _pose(telemetry: Telemetry) -> str:
    return "" if telemetry.pose is None else pose_text(telemetry.pose)


def _position_text(telemetry: Telemetry) -> str:
    position = positions.position(telemetry)
    return "" if position is None else f"{vector_text(position)} in map"
