"""The page of the command line: the help of `ual` and `ual-daemon`, from the commands themselves."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Sequence

import click

from tools.pages.commands import all_commands
from ual_daemon.program.main import main as daemon

_HEAD = """# Options of `ual` and `ual-daemon`

<!-- `make pages` writes this page from the programs' own help. -->

Every command with its options, as `ual COMMAND --help` prints them. [The `ual` command](cli.md) explains what they have
in common, and [configuration](configuration.md) the settings of the daemon.
"""


def page() -> str:
    """Returns the page."""
    leaves = list(_leaves(click.Group(commands=all_commands()), "ual"))
    shared = {name for name, _ in _options(leaves[0][1])}.intersection(
        *({n for n, _ in _options(c)} for _, c in leaves)
    )
    common = [text for name, text in _options(leaves[0][1]) if name in shared]
    parts = [_HEAD, "## Options of every command\n", "\n".join(common) + "\n"]
    for name, command in leaves:
        parts.append(f"## {name}\n")
        parts.append(f"    {' '.join([name, *_pieces(command, name)])}\n")
        parts.append(_help(command))
        if own := [text for option, text in _options(command) if option not in shared]:
            parts.append("\n".join(own) + "\n")
    parts.append("## ual-daemon\n")
    parts.append(_help(daemon))
    parts.append("\n".join(text for _, text in _options(daemon)) + "\n")
    return "\n".join(part for part in parts if part).rstrip() + "\n"


def _leaves(command: click.Command, name: str) -> Iterator[tuple[str, click.Command]]:
    if isinstance(command, click.Group):
        for each in sorted(command.commands):
            if not command.commands[each].hidden:
                yield from _leaves(command.commands[each], f"{name} {each}")
    else:
        yield name, command


def _pieces(command: click.Command, name: str) -> Sequence[str]:
    return command.collect_usage_pieces(click.Context(command, info_name=name))


def _options(command: click.Command) -> Iterator[tuple[str, str]]:
    for each in command.params:
        if isinstance(each, click.Option) and not each.hidden and each.opts:
            record = each.get_help_record(click.Context(command))
            if record is not None:
                yield each.opts[0], f"- `{record[0]}`: {_prose(record[1])}"


def _help(command: click.Command) -> str:
    text = inspect.cleandoc(command.help or "").replace("\b\n", "")
    return "\n\n".join(_prose(" ".join(part.split())) for part in text.split("\n\n")) + "\n" if text else ""


def _prose(text: str) -> str:
    """Returns a text of help as Markdown: what stands in angle brackets is no markup."""
    return re.sub(r"(`[^`]*`)|([<*_])", lambda found: found[1] or f"\\{found[2]}", text)
