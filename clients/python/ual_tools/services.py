"""The commands of the services beside flying. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

import click

from ual_tools import cameras, fence, gimbals, gripper, logs, parameters

COMMANDS: tuple[click.Command, ...] = (
    *cameras.COMMANDS,
    *fence.COMMANDS,
    *gimbals.COMMANDS,
    *gripper.COMMANDS,
    *logs.COMMANDS,
    *parameters.COMMANDS,
)
