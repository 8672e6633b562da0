"""The ``ual`` command with all its commands."""

from __future__ import annotations

import os
import signal

import click

from ual.errors import InvalidArgumentError
from ual.shared import environment
from ual_tools import (
    __version__,
    audit,
    certificates,
    check,
    completion,
    extpose,
    flight,
    frames,
    launch,
    lease,
    missions,
    path,
    record,
    services,
    simulation,
    status,
    streams,
    task,
    tokens,
    waypoints,
    where,
)
from ual_tools.app import UalGroup
from ual_tools.help import WIDEST_COLUMNS
from ual_tools.network import gateway, router
from ual_tools.ros2 import command as ros2
from ual_tools.rtcm import command as rtcm
from ual_tools.teleop import command as teleop
from ual_tools.view import command as view


@click.group(
    cls=UalGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": WIDEST_COLUMNS},
    examples=(
        "ual list",
        "ual takeoff 3",
        "ual goto 4 2 3 --yaw 90deg",
        "ual --ns uav_2 --json state",
        "ual watch --all",
    ),
)
@click.version_option(__version__, prog_name="ual")
def cli() -> None:
    """Fly a UAV through its daemon.

    Without --ns and --address this is the only UAV of this computer. The options below may also stand behind the
    command. Exit status: 0 done, 1 refused or failed (the reason is on stderr), 2 wrong usage, 130 interrupted.
    """
    try:
        environment.require_known()
    except InvalidArgumentError as error:
        raise click.UsageError(error.message) from None


for command in (
    *status.COMMANDS,
    *lease.COMMANDS,
    *flight.COMMANDS,
    *teleop.COMMANDS,
    *task.COMMANDS,
    *path.COMMANDS,
    *frames.COMMANDS,
    *where.COMMANDS,
    *waypoints.COMMANDS,
    *missions.COMMANDS,
    *services.COMMANDS,
    *rtcm.COMMANDS,
    *simulation.COMMANDS,
    *tokens.COMMANDS,
    *certificates.COMMANDS,
    *router.COMMANDS,
    *gateway.COMMANDS,
    *audit.COMMANDS,
    *check.COMMANDS,
    *extpose.COMMANDS,
    *record.COMMANDS,
    *view.COMMANDS,
    *launch.COMMANDS,
    *ros2.COMMANDS,
    *completion.COMMANDS,
):
    cli.add_command(command)


def main() -> None:
    """The entry point."""
    # gRPC's core would write its own messages to stderr, beside the one line with the reason.
    streams.prepare()
    # From now on an interruption is handled, also where a shell without a terminal has started this with `&`.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.environ.setdefault("GRPC_VERBOSITY", "NONE")
    cli(prog_name="ual")
