"""Shows what a team would run: each command line as it would be typed."""

from __future__ import annotations

import os
import shlex

from ual_tools.launch.team import Condition, Program, Team


def text(team: Team) -> str:
    """Returns the command lines of a team in the order of its file, and above each what it waits for."""
    return "\n".join(f"# {_about(each)}\n{command_line(each)}" for each in team.programs)


def command_line(program: Program) -> str:
    """Returns one command line, quoted for a shell, with its directory and its variables."""
    words = [f"{name}={shlex.quote(value)}" for name, value in program.env.items()]
    line = " ".join([*words, shlex.join(program.argv)])
    is_here = os.path.abspath(program.cwd) == os.getcwd()  # noqa: PTH100, PTH109  does not resolve links
    return line if is_here else f"cd {shlex.quote(str(program.cwd))} && {line}"


def _about(program: Program) -> str:
    parts = [program.name]
    if program.needs:
        parts.append(f"after {', '.join(program.needs)}")
    condition = program.ready.condition
    if condition is not Condition.STARTED:
        parts.append(f"ready by {condition.value} {program.ready.value}".rstrip())
    parts.append(f"restart {program.restart.value}")
    return "; ".join(parts)
