"""Help of `ual`: sections of commands, examples, and suggestions for a mistyped word."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from enum import Enum
from typing import NamedTuple

import click


class Section(Enum):
    """The part of `ual --help` in which a command stands. They are shown in this order."""

    LOOKING = "Looking"
    FLYING = "Flying"
    TASKS = "What is flown now"
    FRAMES = "Frames and waypoints"
    AUTOPILOT = "The autopilot's own"
    CARRIED = "What it carries"
    SIMULATION = "Simulation"
    ACCESS = "Who may fly"
    TEAMS = "Teams and networks"
    TOOLS = "Checks and shell"


class ListedCommand(NamedTuple):
    """Section and line of a command in `ual --help`, and the module that has it in its `COMMANDS`."""

    module: str
    section: Section
    short_help: str


MOST_HELP_COLUMNS = 120
"""The help uses the width of the terminal, up to this: longer lines are hard to read."""

ALIASES: Mapping[str, str] = {"simulation": "sim"}
"""Other names by which a command of `ual` is found."""

_MEANT: Mapping[str, str] = {
    "take-off": "takeoff",
    "go-to": "goto",
    "fly": "goto",
    "move": "goto",
    "stop": "abort",
    "hold": "abort",
    "cancel": "abort",
    "status": "state",
    "telemetry": "watch",
    "ls": "list",
    "ps": "list",
}

# How the daemon names a command, and how it is typed here.
_TYPED: Mapping[str, str] = {
    "take_off": "takeoff",
    "TakeOff": "takeoff",
    "Land": "land",
    "go_to_waypoint": "goto",
    "GoToWaypoint": "goto",
    "go_to_waypoint_geo": "goto-geo",
    "GoToWaypointGeo": "goto-geo",
    "follow_path": "path",
    "FollowPath": "path",
    "set_pose": "pose",
    "SetPose": "pose",
    "set_velocity": "velocity",
    "SetVelocity": "velocity",
    "recover_from_manual": "recover",
    "RecoverFromManual": "recover",
    "return_to_launch": "rtl",
    "ReturnToLaunch": "rtl",
    "Pause": "pause",
    "Resume": "resume",
    "set_home": "home",
    "SetHome": "home",
    "pilot_arm": "sim arm",
    "pilot_disarm": "sim disarm",
}
_NAMES = re.compile(rf"\b(?:{'|'.join(sorted(_TYPED, key=len, reverse=True))})\b")


def as_typed(text: str) -> str:
    """Returns a message with the names of commands as they are typed."""
    return _NAMES.sub(lambda match: _TYPED[match[0]], text)


def no_such_command(name: str, known: Iterable[str]) -> str:
    """Returns the message for a command that does not exist, with what may have been meant."""
    names = list(known)
    spelled = name.lower().replace("_", "-")
    meant = [_MEANT[spelled]] if _MEANT.get(spelled) in names else close(spelled, names)
    return f"No such command {name!r}.{did_you_mean(meant)}"


def close(word: str, known: Iterable[str]) -> list[str]:
    """Returns the words that are spelled in a similar way."""
    return difflib.get_close_matches(word, list(known), n=3, cutoff=0.6)


def did_you_mean(words: Sequence[str]) -> str:
    """Returns the question that is added to a message, empty without words."""
    return f" Did you mean {' or '.join(words)}?" if words else ""


def write_examples(formatter: click.HelpFormatter, examples: Sequence[str]) -> None:
    """Writes examples, each on one line as it is typed."""
    if examples:
        with formatter.section("Examples" if len(examples) > 1 else "Example"):
            for each in examples:
                formatter.write(f"{'':>{formatter.current_indent}}{each}\n")


def write_commands(formatter: click.HelpFormatter, commands: Mapping[str, ListedCommand]) -> None:
    """Writes one list of commands for each section."""
    for section in Section:
        found = {name: each.short_help for name, each in commands.items() if each.section is section}
        limit = formatter.width - 6 - max(map(len, found), default=0)
        if found:
            with formatter.section(section.value):
                formatter.write_dl([(name, _shortened(text, limit)) for name, text in found.items()])


def _shortened(text: str, limit: int) -> str:
    return click.Command(None, help=text).get_short_help_str(limit)
