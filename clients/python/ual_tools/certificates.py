"""`ual certificates`: a small authority for a team, and the certificates of its daemons and callers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from ual.access import tokens
from ual.errors import InvalidArgumentError
from ual.shared import extras
from ual_tools.app import UalGroup, command
from ual_tools.help import Section
from ual_tools.session import Session, pass_session
from ual_tools.values import Number

if TYPE_CHECKING:
    from types import ModuleType

    from ual_tools.access.certificates import Files

F = TypeVar("F", bound=Callable[..., Any])

_LONGEST_DAYS = 3650.0


def _directory(function: F) -> F:
    return click.option(
        "--dir",
        "directory",
        type=click.Path(file_okay=False, path_type=Path),
        default=Path("certificates"),
        show_default=True,
        help="Where the authority and the certificates are.",
    )(function)


def _days(default: float) -> Callable[[F], F]:
    return click.option(
        "--days",
        type=Number(0.0, _LONGEST_DAYS, min_open=True),
        default=default,
        show_default=True,
        help="How long it is valid.",
    )


@click.group(
    "certificates",
    cls=UalGroup,
    section=Section.ACCESS,
    examples=("ual certificates authority", "ual certificates caller laptop"),
)
def certificates() -> None:
    """Make the TLS certificates of a team.

    An authority of your own signs those of the daemons and of the callers. Needs ual-tools[access]. Keep
    authority.key off the computers that fly: whoever has it can be anybody.
    """


@command("authority", "ual certificates authority", section=Section.ACCESS)
@click.option("--name", default="UAL team", show_default=True, help="What it is called in its certificates.")
@_days(_LONGEST_DAYS)
@_directory
@pass_session
def authority(session: Session, name: str, days: float, directory: Path) -> None:
    """Make the authority.

    authority.pem is for everybody, authority.key is secret.
    """
    module = _module()
    _made(session, lambda: module.make_authority(directory, name, days))


@command("daemon", "ual certificates daemon uav_1 --host uav-1.local --host 10.0.0.11", section=Section.ACCESS)
@click.argument("name")
@click.option("--host", "hosts", multiple=True, required=True, help="A name or address by which callers reach it.")
@_days(365.0)
@_directory
@pass_session
def daemon(session: Session, name: str, hosts: tuple[str, ...], days: float, directory: Path) -> None:
    """Make the certificate of a daemon.

    It is used by `ual-daemon --tls-certificate NAME.pem --tls-key NAME.key`.
    """
    module = _module()
    _made(session, lambda: module.make_daemon(directory, _checked(name), hosts, days))


@command("caller", "ual certificates caller field-laptop --days 30", section=Section.ACCESS)
@click.argument("name")
@_days(365.0)
@_directory
@pass_session
def caller(session: Session, name: str, days: float, directory: Path) -> None:
    """Make the certificate of a caller.

    What NAME may do, the daemon's roles file says.
    """
    module = _module()
    _made(session, lambda: module.make_caller(directory, _checked(name), days))


def _module() -> ModuleType:
    with extras.needs("ual certificates", "ual-tools[access]"):
        from ual_tools.access import certificates as module
    return module


def _made(session: Session, make: Callable[[], Files]) -> None:
    try:
        made = make()
    except FileExistsError as error:
        raise InvalidArgumentError(
            f"{error.filename} is there already: remove it first, or choose another name"
        ) from None
    except FileNotFoundError as error:
        raise InvalidArgumentError(f"there is no {error.filename}: `ual certificates authority` makes it") from None
    except OSError as error:
        raise InvalidArgumentError(f"{error.filename}: {error.strerror}") from None
    except ValueError as error:
        raise InvalidArgumentError(str(error)) from None
    session.emit({"certificate": made.certificate, "key": made.key}, f"{made.certificate}\n{made.key}")


def _checked(name: str) -> str:
    tokens.require_name(name)
    if name == "authority":  # its files
        raise ValueError(f"{name!r} is no name for it: the authority has that")
    return name


for _command in (authority, daemon, caller):
    certificates.add_command(_command)
COMMANDS = (certificates,)
