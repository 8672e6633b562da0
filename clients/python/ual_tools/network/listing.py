"""`ual list --network`: all UAVs of the network by what they tell, those that are gone included."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from ual.errors import DaemonUnreachableError
from ual_tools import condition
from ual_tools.condition import STYLES, UavCondition, Urgency
from ual_tools.network.joined import Joined, label
from ual_tools.session import CommandSession
from ual_tools.tables import print_table

if TYPE_CHECKING:
    from ual.network import Network, NetworkUav

_HEADER = ("uav", "state", "backend", "address", "host", "age", "battery", "to fly it")
_GREY = "bright_black"


def list_uavs(session: CommandSession, joined: Joined) -> None:
    """Prints a line for each UAV, the worst first.

    Raises:
        DaemonUnreachableError: Something is there that is not seen.

    """
    network = joined.network()
    _print(session, network)
    if unseen := network.unseen:
        raise DaemonUnreachableError(f"not all UAVs of the network are seen: {'; '.join(unseen)}")


def _print(session: CommandSession, network: Network) -> None:
    now_s, utc_s = time.monotonic(), time.time()
    known = condition.worst_first(network.uavs(), lambda uav: condition_of(uav, now_s), lambda uav: uav.ns)
    if session.as_json:
        for uav in known:
            session.emit(_fields(uav, now_s, utc_s))
        return
    rows = [_cells(uav, now_s) for uav in known]
    if not sys.stdout.isatty():
        print_table((), [(*row, condition_of(uav, now_s).note) for row, uav in zip(rows, known, strict=True)])
    elif known:
        styles = [_GREY if uav.gone_s is not None else STYLES[condition_of(uav, now_s).level] for uav in known]
        print_table(_HEADER, rows, styles)
        _print_trouble(known, now_s)
    else:
        click.echo(f"no UAV is on the network ({network.described}): start daemons with `ual-daemon --network`")


def condition_of(uav: NetworkUav, now_s: float) -> UavCondition:
    """Returns how a UAV is by what is known of it."""
    text = trouble(uav, now_s)
    return UavCondition(Urgency.ALARM, "LOST", text, text) if text else condition.of_telemetry(uav.telemetry)


def trouble(uav: NetworkUav, now_s: float) -> str:
    """Returns why a sample must not be taken for the present, or nothing."""
    was = f"it was {uav.telemetry.state.name}"
    if uav.gone_s is not None:
        return f"gone from the network for {now_s - uav.gone_s:.0f} s, {was}"
    if uav.is_contested:
        return f"several UAVs have the name {uav.ns}: {uav.described()}"
    if uav.is_old(now_s):
        return f"no telemetry for {now_s - uav.heard_s:.0f} s, {was}"
    return ""


def _cells(uav: NetworkUav, now_s: float) -> tuple[str, ...]:
    return (
        label(uav),
        condition_of(uav, now_s).state,
        uav.report.backend,
        " ".join(uav.addresses),
        uav.teller.host,
        f"{now_s - uav.heard_s:.1f} s",
        condition.battery_text(uav.telemetry.battery),
        _access(uav),
    )


def _access(uav: NetworkUav) -> str:
    """Returns what a caller of another computer needs to fly it."""
    if uav.report.is_watch_only:
        return "watched only"
    return ", ".join(filter(None, ("TLS" * uav.report.has_tls, uav.report.needed_role))) or "open"


def _fields(uav: NetworkUav, now_s: float, utc_s: float) -> dict[str, object]:
    how, sample = condition_of(uav, now_s), uav.telemetry
    return {
        "ns": uav.ns,
        "state": sample.state,
        "is_present": uav.gone_s is None,
        "gone_since_s": None if uav.gone_s is None else utc_s - (now_s - uav.gone_s),
        "is_contested": uav.is_contested,
        "age_s": now_s - uav.heard_s,
        "state_reason": sample.state_reason,
        "reason": sample.state_reason,
        "battery_percent": None if sample.battery is None else sample.battery.remaining_percent,
        "level": how.level,
        "wrong": how.text,
        "backend": uav.report.backend,
        "addresses": list(uav.addresses),
        "has_tls": uav.report.has_tls,
        "needed_role": uav.report.needed_role,
        "is_watch_only": uav.report.is_watch_only,
        "host": uav.teller.host,
        "publisher": uav.publisher,
        "pid": uav.teller.pid,
        "started_s": uav.teller.started_s,
    }


def _print_trouble(known: Sequence[NetworkUav], now_s: float) -> None:
    """Prints what is wrong with each, and how many there are of each state."""
    for uav in known:
        how = condition_of(uav, now_s)
        if how.text:
            click.secho(f"{label(uav)}: {how.text}", fg="red" if how.level is Urgency.ALARM else "yellow")
    click.echo(f"{len(known)} UAV{'s' * (len(known) > 1)}: {condition.summary(condition_of(u, now_s) for u in known)}")
