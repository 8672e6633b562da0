"""``ual launch`` runs a team by its file, shows what it would run, or writes what starts it at boot."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ual import discovery
from ual.errors import InvalidArgumentError, NotSupportedError
from ual.shared import whole_file
from ual_tools.app import command
from ual_tools.help import Section
from ual_tools.session import CommandSession, note, pass_session
from ual_tools.strict_yaml.loading import WRONG_FILE_STATUS, loaded

if TYPE_CHECKING:
    from ual_tools.launch.team import Team

_FAILED_STATUS = 1


@command(
    "launch",
    "ual launch team.yaml",
    "ual launch --print team.yaml",
    "ual launch --systemd units team.yaml",
    section=Section.TEAMS,
)
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--print", "is_shown", is_flag=True, help="Only print the command lines.")
@click.option(
    "--systemd", type=click.Path(file_okay=False, path_type=Path), metavar="DIR", help="Write units of systemd instead."
)
@click.option(
    "--compose", type=click.Path(dir_okay=False, path_type=Path), metavar="FILE", help="Write a compose file instead."
)
@pass_session
def launch(session: CommandSession, file: Path, is_shown: bool, systemd: Path | None, compose: Path | None) -> None:
    """Run a team: daemons, and programs next to them.

    Ctrl-C lands the UAVs that this team flies, then ends all programs. Ctrl-C again holds them and ends at once; a
    third one kills.
    """
    if session.ns or session.is_all or session.address:
        text = "the UAVs of a team are those of its file: leave out --ns, --all and --address (UAL_NS, UAL_ADDRESS)"
        raise click.UsageError(text)
    if not hasattr(os, "killpg"):
        raise NotSupportedError("ual launch starts daemons, which run on Linux and macOS")
    team = loaded(_load, file, "ual launch", "ual-tools[launch]")
    if is_shown:
        from ual_tools.launch import shown

        for program in team.programs:
            session.emit(shown.values(program), shown.text(program))
    elif systemd is not None or compose is not None:
        _write(team, systemd, compose)
    else:
        _run(team)


def _load(file: Path) -> Team:
    from ual_tools.launch.team_file import load

    return load(file)


def _write(team: Team, directory: Path | None, file: Path | None) -> None:
    from ual_tools.launch import compose, systemd
    from ual_tools.launch.boot import CannotExpressError

    try:
        texts = {} if directory is None else {directory / name: text for name, text in systemd.units(team).items()}
        if file is not None:
            texts[file] = compose.text(team)
    except CannotExpressError as error:
        note(f"ual: {team.file}: {error}")
        raise click.exceptions.Exit(WRONG_FILE_STATUS) from None
    for path, text in texts.items():
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            whole_file.write(path, text)
        except OSError as error:
            raise InvalidArgumentError(f"cannot write {path}: {error.strerror}", {"field": "file"}) from None
        click.echo(path)


def _run(team: Team) -> None:
    import asyncio
    import logging

    _refuse_running(team)

    from ual_tools.launch import run
    from ual_tools.launch.log import TeamLog

    logging.getLogger("ual").addHandler(logging.NullHandler())  # the log of the team says what a lost daemon means
    with TeamLog([each.name for each in team.programs]) as log:
        is_good = asyncio.run(run.run(team, log))
    if not is_good:
        raise click.exceptions.Exit(_FAILED_STATUS)


def _refuse_running(team: Team) -> None:
    """Ends the program if a UAV of the team has a daemon already: nothing is started then, no simulator either."""
    for daemon in team.daemons:
        running = discovery.registered(daemon.ns)
        if running is not None:
            note(f"ual: {daemon.ns} has a daemon already, pid {running.pid} at {running.address}: end it first")
            raise click.exceptions.Exit(_FAILED_STATUS)


COMMANDS = (launch,)
