"""Commands that return home, and that pause and resume what runs."""

from __future__ import annotations

import click

from ual_tools import manoeuvre, options, values
from ual_tools.app import Multi, command
from ual_tools.help import Section
from ual_tools.session import CommandSession, pass_session

_INTERRUPTED = (
    f"{manoeuvre.CANCELLED}; a landing that has begun goes on: ual abort ends it only where there is no safety pilot"
)


@command("rtl", "ual rtl", "ual rtl --height 30", multi=Multi.REACHABLE)
@click.option(
    "--height",
    "height_m",
    type=values.number,
    metavar="M",
    help="Fly home at least so high above the ground of the take-off; the daemon's rtl_height_m (15 m) when not given.",
)
@options.dry_run
@pass_session
def rtl(session: CommandSession, height_m: float | None, dry_run: bool) -> None:
    """Return home and land: climb, fly straight over home, descend.

    Home is the autopilot's home position; where that is not known, the place where it took off. Ctrl-C cancels until
    the landing begins: the UAV holds its position.
    """
    with session.connect() as uav, manoeuvre.standing_is_done(session, "rtl"):
        if dry_run:
            manoeuvre.print_plan(session, uav.dry_run.return_to_launch(height_m))
            return
        manoeuvre.wait_for(
            session,
            uav,
            lambda: uav.return_to_launch(height_m, timeout_s=session.timeout_s),
            interrupted=_INTERRUPTED,
        )


@command("pause", "ual pause", section=Section.TASKS, multi=Multi.REACHABLE)
@pass_session
def pause(session: CommandSession) -> None:
    """Stop the running task on its way and hold.

    `ual resume` goes on.
    """
    with session.connect() as uav:
        uav.pause()
    session.emit({"done": "pause"}, "paused: ual resume goes on")


@command("resume", "ual resume", section=Section.TASKS, multi=Multi.EACH)
@pass_session
def resume(session: CommandSession) -> None:
    """Go on with the paused task, along the rest of its way."""
    with session.connect() as uav:
        uav.resume()
    session.emit({"done": "resume"}, "resumed")


COMMANDS = (rtl, pause, resume)
