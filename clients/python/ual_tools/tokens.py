"""`ual token`: makes, lists and revokes the tokens of a daemon (``ual-daemon --tokens FILE``)."""

from __future__ import annotations

from datetime import datetime, timedelta, timezone
from pathlib import Path

import click

from ual.access import roles, tokens
from ual.access.roles import Role
from ual.access.tokens import Token
from ual.errors import InvalidArgumentError
from ual.shared import whole_file
from ual_tools.app import UalGroup, command
from ual_tools.help import Section
from ual_tools.session import CommandSession, pass_session
from ual_tools.tables import print_table
from ual_tools.values import Number

_ROLES = [role.text for role in Role if role is not Role.NONE]
_VALIDITY_DAYS = 3650.0

_file = click.option(
    "--file",
    type=click.Path(dir_okay=False, path_type=Path),
    default=Path("tokens.json"),
    show_default=True,
    help="The daemon's file of tokens.",
)


@click.group("token", cls=UalGroup, section=Section.ACCESS, examples=("ual token new --role pilot --name laptop",))
def token() -> None:
    """Make, list and revoke the tokens of callers.

    By tokens callers on other computers are known. A running daemon notices within a second what has changed.
    """


@command("new", "ual token new --role pilot --name field-laptop --days 30", section=Section.ACCESS)
@click.option("--name", required=True, help="Whose it is: by this it appears in logs and in the audit.")
@click.option("--role", type=click.Choice(_ROLES), required=True, help="What it permits.")
@click.option("--days", type=Number(0.0, _VALIDITY_DAYS, min_open=True), help="How long it is valid.  [for ever]")
@click.option(
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Write the token into this new file, which only you can read, instead of printing it.",
)
@_file
@pass_session
def new(session: CommandSession, name: str, role: str, days: float | None, output: Path | None, file: Path) -> None:
    """Make a token and print it, or write it into a file of its own.

    It is shown only this once: the daemon's file has a hash of it.
    """
    known = _read(file, may_be_missing=True)
    if any(each.name == name for each in known):
        raise InvalidArgumentError(f"{file} has a token {name} already: revoke it, or choose another --name")
    now = datetime.now(timezone.utc)
    expires = None if days is None else now + timedelta(days=days)
    try:
        secret, made = tokens.make(name, roles.parse(role), expires, now)
    except ValueError as error:
        raise InvalidArgumentError(str(error)) from None
    result = {"name": name, "role": role, "expires": None if expires is None else _text(expires)}
    if output is not None:
        _create(output, secret)  # first: a token that is lost must not be valid
    try:
        _write(file, (*known, made))
    except InvalidArgumentError:
        if output is not None:
            output.unlink()  # it is not valid, and would be in the way of the next try
        raise
    if output is None:
        session.emit({**result, "token": secret}, secret)
    else:
        session.emit_written(
            {**result, "output": str(output)}, f"{output}: the token of {name}, for you only (mode 0600)"
        )


@command("list", "ual token list", section=Section.ACCESS)
@_file
@pass_session
def list_tokens(session: CommandSession, file: Path) -> None:
    """List the tokens: whose, what for, until when."""
    now, rows = datetime.now(timezone.utc), []
    for each in _read(file):
        until = "for ever" if each.expires is None else _text(each.expires)
        status = "expired" if each.has_expired(now) else "valid"
        session.emit({"name": each.name, "role": each.role.text, "expires": until, "status": status})
        rows.append((each.name, each.role.text, _text(each.created), until, status))
    if not session.as_json:
        print_table(("name", "role", "made", "valid until", ""), rows)


@command("revoke", "ual token revoke field-laptop", section=Section.ACCESS)
@click.argument("name")
@_file
@pass_session
def revoke(session: CommandSession, name: str, file: Path) -> None:
    """Remove a token.

    Calls with it are refused, and its streams end within 10 s.
    """
    known = _read(file)
    left = tuple(each for each in known if each.name != name)
    if len(left) == len(known):
        names = ", ".join(each.name for each in known) or "none"
        raise InvalidArgumentError(f"{file} has no token {name} (it has: {names})")
    _write(file, left)
    session.emit({"done": "revoke", "name": name}, f"revoked {name}")


def _read(file: Path, *, may_be_missing: bool = False) -> tuple[Token, ...]:
    try:
        return tokens.read(file.read_bytes())
    except FileNotFoundError:
        if may_be_missing:
            return ()
        raise InvalidArgumentError(f"there is no {file}: name the daemon's file by --file") from None
    except OSError as error:
        raise InvalidArgumentError(f"{file} cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise InvalidArgumentError(f"{file}: {error}") from None


def _create(file: Path, secret: str) -> None:
    try:
        whole_file.create(file, f"{secret}\n".encode())
    except FileExistsError:
        raise InvalidArgumentError(f"{file} is there already: it may have a token that is in use") from None
    except OSError as error:
        raise InvalidArgumentError(f"{file} cannot be written: {error.strerror}") from None


def _write(file: Path, all_tokens: tuple[Token, ...]) -> None:
    try:
        whole_file.write(file, tokens.write(all_tokens), whole_file.OWNER_PERMISSIONS)
    except OSError as error:
        raise InvalidArgumentError(f"{file} cannot be written: {error.strerror}") from None


def _text(time: datetime) -> str:
    return time.astimezone(timezone.utc).strftime("%Y-%m-%d %H:%M UTC")


for _command in (new, list_tokens, revoke):
    token.add_command(_command)
COMMANDS = (token,)
