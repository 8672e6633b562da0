"""Commands that only read: which UAVs there are, and their state."""

from __future__ import annotations

import dataclasses
import math
import sys
import threading
import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import click

from ual import discovery
from ual.discovery import Registration
from ual.errors import DaemonUnreachableError, UalError
from ual.types import Health, State, Telemetry
from ual_tools import condition
from ual_tools.app import Multi, command
from ual_tools.condition import STYLES, UavCondition, Urgency
from ual_tools.help import Section
from ual_tools.output import to_json
from ual_tools.selection import ask_all
from ual_tools.session import REFUSED_STATUS, CommandSession, pass_session
from ual_tools.tables import print_table
from ual_tools.watch import watch

_COLOURS: dict[Urgency, dict[str, Any]] = {
    Urgency.FINE: {},
    Urgency.WARNING: {"fg": "yellow", "bold": True},
    Urgency.ALARM: {"fg": "red", "bold": True},
}
"""Of click."""
_HEADER = ("uav", "state", "backend", "address", "pid", "battery")
_POLL_PERIOD_S = 0.2
"""Seconds between two looks of `ual wait` for a daemon that is not there."""
_STATES = [state.name for state in State]


@command("list", "ual list", "ual list --network", "ual --json list", section=Section.LOOKING, multi=Multi.ITSELF)
@pass_session
def list_uavs(session: CommandSession) -> None:
    """List the UAVs, the worst first.

    They are those whose daemons run on this computer, or with --network those of the network.
    """
    if session.joined is not None:
        from ual_tools.network import listing

        listing.list_uavs(session, session.joined)
        return
    if session.address is not None:
        session.tell("these run on this computer; --address (UAL_ADDRESS) is not listed: `ual info` asks it")
    daemons = discovery.list_daemons()
    known = [_Known(daemon, found) for daemon, found in zip(daemons, ask_all(session, daemons), strict=True)]
    known = condition.worst_first(known, lambda each: each.how, lambda each: each.daemon.ns)
    if session.as_json:
        for each in known:
            session.emit(_fields(each))
        return
    if not sys.stdout.isatty():
        print_table((), [(*_cells(each), each.how.note) for each in known])
    elif known:
        print_table(_HEADER, [_cells(each) for each in known], [STYLES[each.how.level] for each in known])
        _print_trouble(known)
    else:
        click.echo("no daemon runs on this computer: start one with `ual-daemon`")


class _Known(NamedTuple):
    """A daemon, and what it answered."""

    daemon: Registration
    found: Telemetry | UalError

    @property
    def how(self) -> UavCondition:
        return condition.of_answer(self.found)


def _fields(each: _Known) -> dict[str, object]:
    sample = each.found if isinstance(each.found, Telemetry) else None
    battery = None if sample is None else sample.battery
    return {
        "ns": each.daemon.ns,
        "state": None if sample is None else sample.state,
        "state_reason": "" if sample is None else sample.state_reason,
        "reason": each.found.reason if isinstance(each.found, UalError) else each.found.state_reason,
        "battery_percent": None if battery is None else battery.remaining_percent,
        "level": each.how.level,
        "wrong": each.how.text,
        "backend": each.daemon.backend,
        "address": each.daemon.address,
        "pid": each.daemon.pid,
        "started_s": each.daemon.started_s,
    }


def _cells(each: _Known) -> tuple[str, ...]:
    daemon, how = each.daemon, each.how
    battery = condition.battery_text(each.found.battery) if isinstance(each.found, Telemetry) else ""
    return daemon.ns, how.state, daemon.backend, daemon.address, str(daemon.pid), battery


def _print_trouble(known: Sequence[_Known]) -> None:
    """Prints what is wrong with each, and how many there are of each state."""
    for each in known:
        if each.how.text:
            click.secho(f"{each.daemon.ns}: {each.how.text}", **_COLOURS[each.how.level])
    click.echo(f"{len(known)} UAV{'s' * (len(known) > 1)}: {condition.summary(each.how for each in known)}")


@command("info", "ual info", "ual --ns uav_2 info", section=Section.LOOKING)
@pass_session
def info(session: CommandSession) -> None:
    """Print the UAV's name, its autopilot, and what it can do."""
    with session.connect() as uav:
        found = uav.info()
    if session.as_json:
        fields = to_json(found)
        assert isinstance(fields, dict)
        session.emit({"ns": found.namespace, **fields})
        return
    limits = found.limits
    rows = (
        ("namespace", found.namespace),
        ("backend", found.backend + (" (simulation)" if found.is_simulation else "")),
        ("autopilot", f"{found.autopilot or 'not known yet'} {found.autopilot_version}".strip()),
        ("url", found.url),
        ("daemon", found.ual_version),
        ("can", ", ".join(sorted(capability.name for capability in found.capabilities))),
        ("safety pilot", "can take over" if found.has_safety_pilot else "none: abort ends take-offs and landings, too"),
        ("arming", "permitted" if found.is_arming_allowed else "by the safety pilot only"),
        ("horizontal speed", f"{limits.horizontal_speed_m_s:g} m/s"),
        ("horizontal acceleration", f"{limits.horizontal_acceleration_m_s2:g} m/s²"),
        (
            "vertical speed",
            f"{limits.climb_speed_m_s:g} m/s up, {limits.descent_speed_m_s:g} m/s down",
        ),
        ("vertical acceleration", f"{limits.vertical_acceleration_m_s2:g} m/s²"),
        ("yaw rate", f"{math.degrees(limits.yaw_rate_rad_s):.0f} °/s"),
    )
    print_table(("", ""), rows)


@command("state", "ual state", "ual --json state", section=Section.LOOKING, multi=Multi.LOOKING)
@pass_session
def state(session: CommandSession) -> None:
    """Print the state of the UAV.

    On a terminal with its reason, its battery, and what is wrong; of several UAVs the worst first, and how many there
    are of each state at the end. Into a pipe the name only, and what is wrong to standard error.
    """
    with session.connect() as uav:
        telemetry = uav.telemetry()
        ns = uav.ns
    if session.member is not None:
        session.member.condition = condition.of_telemetry(telemetry)
    session.emit(
        {
            "ns": ns,
            "state": telemetry.state,
            "state_reason": telemetry.state_reason,
            "reason": telemetry.state_reason,
            "battery_percent": None if telemetry.battery is None else telemetry.battery.remaining_percent,
            "batteries": [dataclasses.asdict(each) for each in telemetry.batteries],
            "flight_mode": telemetry.flight_mode,
            "gps": telemetry.gps,
            "frame_lost": telemetry.frame_lost,
            **_health_fields(telemetry.health or Health()),
        },
        _state_text(telemetry, is_one=session.member is None),
    )
    is_unknown, reasons = telemetry.state is State.UNINITIALIZED, _reasons(telemetry)
    shown = reasons if is_unknown else reasons[1:]
    if shown and not sys.stdout.isatty():  # there the name stands alone
        session.tell("; ".join(shown))
    if is_unknown:
        raise click.exceptions.Exit(REFUSED_STATUS)


@command("wait", "ual wait landed_armed --timeout 60", section=Section.LOOKING, multi=Multi.REACHABLE)
@click.argument("states", metavar="STATE…", nargs=-1, required=True, type=click.Choice(_STATES, case_sensitive=False))
@pass_session
def wait(session: CommandSession, states: tuple[str, ...]) -> None:
    """Wait for a state, or for one of several, and print which. It waits for a daemon, too.

    With --timeout it fails (exit status 1) if none of them comes in time: `ual wait landed_armed --timeout 60`.
    """
    ns, reached = _reached(session, [State[name] for name in states])
    session.emit({"ns": ns, "state": reached}, reached.name)


def _reached(session: CommandSession, states: Sequence[State]) -> tuple[str, State]:
    """Waits for a daemon, and until its UAV is in one of some states. Returns the UAV's name and the state."""
    alone = dataclasses.replace(session, member=None)  # it does not keep others waiting until its daemon is there
    began_s, left_s = time.monotonic(), session.timeout_s
    never, is_shown = threading.Event(), False
    while True:
        try:
            with alone.connect() as uav:
                return uav.ns, uav.wait_for(*states, timeout_s=left_s)
        except DaemonUnreachableError as error:
            if session.timeout_s is not None:
                left_s = began_s + session.timeout_s - time.monotonic()
                if left_s <= 0.0:
                    raise
            if not is_shown:
                session.tell(f"waits for a daemon: {error.message}")
                is_shown = True
        never.wait(_POLL_PERIOD_S if left_s is None else min(_POLL_PERIOD_S, left_s))


def _state_text(telemetry: Telemetry, *, is_one: bool) -> str:
    # A pipe gets only the name, so that scripts can compare it.
    if not sys.stdout.isatty():
        return telemetry.state.name
    first, *more = _reasons(telemetry)
    battery = condition.batteries_text(telemetry)
    if is_one:
        lines = (f"{telemetry.state.name}: {first}", *more, f"battery: {battery}" if battery else "")
        text = "\n".join(filter(None, lines))
    else:
        named = f"{telemetry.state.name}, battery {battery}" if battery else telemetry.state.name
        text = f"{named}: {'; '.join((first, *more))}"
    return click.style(text, **_COLOURS[condition.of_telemetry(telemetry).level])


def _reasons(telemetry: Telemetry) -> list[str]:
    """Returns why it is in this state, and what is wrong beside that."""
    health = telemetry.health or Health()
    lines = [telemetry.state_reason]
    if health.failsafe:
        lines.append(f"failsafe: {health.failsafe}")
    if health.failing_checks:
        lines.append(f"fails: {', '.join(health.failing_checks)}")
    if telemetry.frame_lost:
        lines.append(f"it is not known where home is: {telemetry.frame_lost}")
    return lines


def _health_fields(health: Health) -> dict[str, object]:
    return {
        "failsafe": health.failsafe,
        "held_by": health.held_by,
        "is_ready_to_arm": health.is_ready_to_arm,
        "failing_checks": list(health.failing_checks),
        "link_quality": health.link_quality,
    }


COMMANDS = (list_uavs, info, state, wait, watch)
