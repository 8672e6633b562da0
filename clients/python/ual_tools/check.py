"""``ual check`` runs the conformance checks with one UAV."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from ual_tools import complete
from ual_tools.app import command
from ual_tools.help import Section
from ual_tools.session import REFUSED_STATUS, CommandSession, note, pass_session
from ual_tools.tables import print_table

if TYPE_CHECKING:
    from ual.conformance import Check, Flight, Result


@command("check", "ual check --no-motion", "ual check --list", section=Section.TOOLS)
@click.option("--yes", is_flag=True, help="Do not ask.")
@click.option("--no-motion", is_flag=True, help="Only the checks that move nothing.")
@click.option(
    "--only", metavar="NAME", multiple=True, help="Only this check; may be given again.", shell_complete=complete.checks
)
@click.option("--list", "only_list", is_flag=True, help="List the checks, and end.")
@pass_session
def check(session: CommandSession, yes: bool, no_motion: bool, only: tuple[str, ...], only_list: bool) -> None:
    """Check that the UAV does what all UAVs must do.

    It flies within 6 m of where it stands, up to 5 m high. Where its autopilot flies missions, it flies one up to 20 m
    to the north.
    """
    from ual import conformance

    checks = _chosen(conformance.CHECKS, only)
    if only_list:
        _print_list(session, checks)
        return
    with session.connect() as uav:
        flight = conformance.Flight(uav, ask_operator=_ask_operator)
        if not no_motion and not yes:
            _confirm(flight, checks)
        results = []
        try:
            for result in conformance.run(flight, checks, may_move=not no_motion, on_start=_show_start):
                results.append(result)
                _emit(session, result)
        except conformance.CheckFailedError as error:
            note(f"ual: the UAV did not land after the checks: {error}")
            raise click.exceptions.Exit(REFUSED_STATUS) from error
        except KeyboardInterrupt:
            note("ual: interrupted: a UAV in flight holds its position; `ual land` lands it")
            raise
    _print_results(session, results)
    if any(result.outcome is conformance.Outcome.FAILED for result in results):
        raise click.exceptions.Exit(REFUSED_STATUS)


def _chosen(checks: Sequence[Check], only: tuple[str, ...]) -> list[Check]:
    names = [check.name for check in checks]
    for name in only:
        if name not in names:
            raise click.BadParameter(f"there is no check {name!r}; see `ual check --list`", param_hint="--only")
    return [check for check in checks if not only or check.name in only]


def _print_list(session: CommandSession, checks: Sequence[Check]) -> None:
    for each in checks:
        session.emit({"check": each.name, "description": each.description, "moves": each.moves})
    if not session.as_json:
        print_table(("check", "what must hold", "moves"), [(c.name, c.description, c.moves) for c in checks])


def _confirm(flight: Flight, checks: Sequence[Check]) -> None:
    from ual.conformance.runner import why_not

    moving = [check for check in checks if check.moves and not why_not(flight, check)]
    room = "within 6 m of where it stands and up to 5 m high"
    if any("mission" in check.name for check in moving):
        room += ", and in a mission of its autopilot up to 20 m to the north"
    note(f"{flight.uav.ns} ({flight.info.backend}) will move, {room}:")
    for each in moving:
        note(f"  {each.name.replace('_', ' ')}: {each.moves}")
    if not flight.has_pilot and not flight.info.is_arming_allowed:
        note("You will be asked to arm it. Keep the transmitter at hand: taking over ends the running check.")
    if not _is_granted():
        raise click.exceptions.Exit(REFUSED_STATUS)


def _is_granted() -> bool:
    try:
        return click.confirm("Is the space free, and may it fly?", default=False, err=True)
    except click.Abort:  # click's, for Ctrl-C and for the end of the input
        click.echo(err=True)
        if sys.stdin.isatty():
            raise KeyboardInterrupt from None
        note("ual: no answer came; with --yes it flies without asking")
        return False


def _ask_operator(what: str) -> None:
    note(f"Please {what} now.")


def _show_start(check: Check) -> None:
    if sys.stderr.isatty():
        click.echo(f"\r\033[K{check.name.replace('_', ' ')} ...", nl=False, err=True)


def _emit(session: CommandSession, result: Result) -> None:
    session.emit(
        {
            "check": result.check.name,
            "outcome": result.outcome.value,
            "why": result.why,
            "duration_s": round(result.duration_s, 3),
        }
    )


def _print_results(session: CommandSession, results: Sequence[Result]) -> None:
    from ual.conformance import Outcome

    if sys.stderr.isatty():
        click.echo("\r\033[K", nl=False, err=True)
    if session.as_json:
        return
    print_table(
        ("check", "", "seconds", "why"),
        [(r.check.name.replace("_", " "), r.outcome.value, f"{r.duration_s:.1f}", r.why) for r in results],
    )
    counts = {outcome: sum(result.outcome is outcome for result in results) for outcome in Outcome}
    note(", ".join(f"{count} {outcome.value}" for outcome, count in counts.items() if count))


COMMANDS = (check,)
