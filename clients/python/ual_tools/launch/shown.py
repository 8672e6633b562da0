"""Shows what a team would run: each command line as it would be typed."""

from __future__ import annotations

import os
import shlex

from ual_tools.launch.team import Program, ReadyCondition


def text(program: Program) -> str:
    """Returns a command line, and above it what it waits for."""
    return f"# {_about(program)}\n{shell_command(program)}"


def values(program: Program) -> dict[str, object]:
    """Returns the same for a program; `ns` is empty where it is not the daemon of a UAV."""
    return {
        "name": program.name,
        "ns": program.ns,
        "command": list(program.argv),
        "directory": str(program.cwd),
        "variables": dict(program.env),
        "needs": list(program.needs),
    }


def shell_command(program: Program) -> str:
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
    if condition is not ReadyCondition.STARTED:
        parts.append(f"ready by {condition.value} {program.ready.value}".rstrip())
    parts.append(f"restart {program.restart.value}")
    return "; ".join(parts)
