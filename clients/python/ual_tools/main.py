"""The ``ual`` command with all its commands."""

from __future__ import annotations

import os
import signal

import click

from ual.errors import InvalidArgumentError
from ual.shared import environment
from ual_tools import __version__, streams
from ual_tools.command_list import COMMANDS
from ual_tools.help import MOST_HELP_COLUMNS
from ual_tools.lazy import LazyGroup

MODULES = (
    "status",
    "lease",
    "flight",
    "teleop.command",
    "task",
    "path",
    "frames",
    "where",
    "waypoints",
    "missions",
    "services",
    "rtcm.command",
    "simulation",
    "tokens",
    "certificates",
    "network.router",
    "network.gateway",
    "audit",
    "check",
    "extpose",
    "record",
    "view.command",
    "launch.command",
    "ros2.command",
    "completion",
)
"""Modules of the commands, in the order of their sections in `ual --help`."""


@click.group(
    cls=LazyGroup,
    listed=COMMANDS,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": MOST_HELP_COLUMNS},
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


def main() -> None:
    """The entry point."""
    # gRPC's core would write its own messages to stderr, beside the one line with the reason.
    streams.prepare()
    # From now on an interruption is handled, also where a shell without a terminal has started this with `&`.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.environ.setdefault("GRPC_VERBOSITY", "NONE")
    cli(prog_name="ual")
