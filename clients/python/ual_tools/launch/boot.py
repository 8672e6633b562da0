"""Common part of systemd's units and a compose file: readiness and landing as commands of a shell."""

from __future__ import annotations

import shlex

from ual.types import State
from ual_tools.launch.flying import SENDS_NOTHING
from ual_tools.launch.team import AtEnd, Program, ReadyCondition, Team

RUNTIME_DIR = "/run/ual"
"""Folder in which daemons of services register: the same for all users."""


class CannotExpressError(Exception):
    """Content of the file that has no counterpart there."""


def test_of(program: Program, ual: str) -> str | None:
    """Returns a command of bash that succeeds once the program is ready; None where it is ready when it runs.

    Raises:
        CannotExpressError: It is ready by a line of its log, which only `ual launch` reads.
    """
    condition, value = program.ready.condition, program.ready.value
    if condition is ReadyCondition.LOG:
        raise CannotExpressError(
            f"{program.name}: ready by log: only `ual launch` itself reads its output; use port or file"
        )
    if condition is ReadyCondition.PORT:
        host, _, port = value.rpartition(":")
        return f": < /dev/tcp/{host.strip('[]')}/{port}"
    if condition is ReadyCondition.FILE:
        return f"test -e {shlex.quote(value)}"
    if condition is ReadyCondition.SERVING:
        return f"{shlex.quote(ual)} --ns {program.ns} state | grep -qv UNINITIALIZED"
    return None


def landing_of(team: Team, program: Program, ual: str) -> str | None:
    """Returns the command of bash that lands a UAV that UAL flies, if the team is to land at its end.

    In FLYING_MANUAL the safety pilot, a ground station or a failsafe has it: `land` would take it from them.
    """
    if not program.is_daemon or team.at_end is not AtEnd.LAND:
        return None
    words = f"{shlex.quote(ual)} --ns {program.ns}"
    land = f"{words} --take --timeout {team.land_limit_s:g} land"
    looked = f'{words} --json watch --once | grep -F \'"state": "{State.FLYING_AUTO.name}"\''
    return f"! {looked} | grep -qv '{SENDS_NOTHING}' || {land}"
