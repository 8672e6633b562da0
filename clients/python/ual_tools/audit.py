"""`ual audit`: checks what a daemon has written (``ual-daemon --audit FILE``)."""

from __future__ import annotations

from pathlib import Path

import click

from ual.access import audit as chain
from ual.errors import InvalidArgumentError
from ual_tools.app import UalGroup, command
from ual_tools.help import Section
from ual_tools.session import CommandSession, pass_session


@click.group("audit", cls=UalGroup, section=Section.ACCESS, examples=("ual audit verify audit.jsonl",))
def audit() -> None:
    """Check the audit of a daemon."""


@command("verify", "ual audit verify audit.jsonl", section=Section.ACCESS)
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--head", metavar="HASH", help="The last hash, as the daemon has logged it: finds lines cut off the end.")
@pass_session
def verify(session: CommandSession, file: Path, head: str | None) -> None:
    """Check that no line was changed or removed.

    Lines that were added or swapped are found, too.
    A program that can write the file can also compute all hashes again, or cut lines off its end: only --head finds
        that.
    """
    try:
        with file.open("rb") as lines:
            found = chain.verify(lines)
    except chain.BrokenChainError as error:
        raise InvalidArgumentError(f"{file}: {error}") from None
    if head is not None and head != found.head:
        raise InvalidArgumentError(
            f"{file}: it ends with {found.head}, not with the given hash: its end is missing, or all of it was written "
            "anew"
        )
    session.emit(
        {
            "lines": found.lines_count,
            "torn": found.torn_count,
            "lost": found.lost_count,
            "untold": found.untold_count,
            "interruptions": found.interruptions,
            "losses": found.losses,
            "head": found.head,
        },
        f"whole: {found.lines_count} lines{_gaps(found)}; the last hash is {found.head}",
    )


def _gaps(found: chain.Verified) -> str:
    """Returns what the lines say of what is missing."""
    of_them = {"incomplete (its daemon ended amid it)": found.torn_count, "without content": found.untold_count}
    text = "".join(f", {count} of them {what}" for what, count in of_them.items() if count)
    if found.interruptions:
        why = ", ".join(dict.fromkeys(found.interruptions))
        text += f"; it could not be written {len(found.interruptions)} time(s): {why}"
    if found.losses:
        text += f"; it begins after another file of the same name: that one {', '.join(dict.fromkeys(found.losses))}"
    return text + f"; {found.lost_count} LINES ARE MISSING, as the daemon says itself" * bool(found.lost_count)


audit.add_command(verify)
COMMANDS = (audit,)
