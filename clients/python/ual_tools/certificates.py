"""`ual certificates`: a small authority for a team, and the certificates of its daemons and callers."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from ual.access import tokens
from ual.errors import InvalidArgumentError, UalError
from ual.shared import extras
from ual_tools.app import UalGroup, command
from ual_tools.help import Section
from ual_tools.session import CommandSession, pass_session
from ual_tools.values import Number

if TYPE_CHECKING:
    from types import ModuleType

    from ual_tools.access.certificates import Files

F = TypeVar("F", bound=Callable[..., Any])
R = TypeVar("R")

_VALIDITY_DAYS = 3650.0


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
        type=Number(0.0, _VALIDITY_DAYS, min_open=True),
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
    authority.key off the computers that fly: its holder can pose as any caller.
    """


@command("authority", "ual certificates authority", section=Section.ACCESS)
@click.option("--name", default="UAL team", show_default=True, help="What it is called in its certificates.")
@_days(_VALIDITY_DAYS)
@_directory
@pass_session
def authority(session: CommandSession, name: str, days: float, directory: Path) -> None:
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
def daemon(session: CommandSession, name: str, hosts: tuple[str, ...], days: float, directory: Path) -> None:
    """Make the certificate of a daemon, or of a router of the network.

    It is used by `ual-daemon --tls-certificate NAME.pem --tls-key NAME.key`, and by what `ual certificates network`
    writes. On the network NAME is the UAV: uav_7, or uav_1-200 for a fleet.
    """
    module = _module()
    _made(session, lambda: module.make_daemon(directory, _checked(name), hosts, days))


@command("caller", "ual certificates caller field-laptop --days 30", section=Section.ACCESS)
@click.argument("name")
@_days(365.0)
@_directory
@pass_session
def caller(session: CommandSession, name: str, days: float, directory: Path) -> None:
    """Make the certificate of a caller.

    What NAME may do, the daemon's roles file says.
    """
    module = _module()
    _made(session, lambda: module.make_caller(directory, _checked(name), days))


@command(
    "network",
    "ual certificates network farm --router router_1=10.0.0.1 --uav uav_1 --uav uav_2 --observer tablet",
    section=Section.ACCESS,
)
@click.argument("site")
@click.option(
    "--router",
    "routers",
    multiple=True,
    required=True,
    metavar="NAME=HOST[:PORT]",
    help="A router, and where others reach it; as often as there are routers.",
)
@click.option("--uav", "uavs", multiple=True, metavar="NAME", help="A UAV that may publish, or a fleet: uav_1-200.")
@click.option("--observer", "observers", multiple=True, metavar="NAME", help="A caller that may listen.")
@_directory
@pass_session
def network(
    session: CommandSession,
    site: str,
    routers: tuple[str, ...],
    uavs: tuple[str, ...],
    observers: tuple[str, ...],
    directory: Path,
) -> None:
    """Write how routers, UAVs and observers join the network of a site.

    Each needs its certificate first: routers and UAVs by `ual certificates daemon`, observers by `ual certificates
    caller`. A router gets NAME.router.json5, for `ual router` or zenohd, and the others get NAME.network.yaml, for
    `ual-daemon --network` or `ual --network-config`. Name all of them each time: an unnamed one may do nothing.
    """
    _module()
    from ual_tools.access import network_files

    with _refusals("`ual certificates daemon` makes those of routers and UAVs, `ual certificates caller` the others"):
        read = [_router(network_files.Router, each) for each in routers]
        written = network_files.write(directory, network_files.NetworkSite(site, read, uavs, observers))
    session.emit_written({"files": [str(path) for path in written]}, "\n".join(map(str, written)))


def _router(make: Callable[..., R], text: str) -> R:
    match = re.fullmatch(r"([^=]+)=(\[[0-9A-Fa-f:.]+\]|[^:=\s]+)(?::([0-9]{1,5}))?", text)
    if match is None:
        raise click.BadParameter(f"{text!r} is not NAME=HOST or NAME=HOST:PORT", param_hint="--router")
    name = _checked(match[1])
    return make(name, match[2], int(match[3])) if match[3] else make(name, match[2])


def _module() -> ModuleType:
    with extras.needs("ual certificates", "ual-tools[access]"):
        from ual_tools.access import certificates as module
    return module


def _made(session: CommandSession, make: Callable[[], Files]) -> None:
    with _refusals("`ual certificates authority` makes it"):
        made = make()
    session.emit_written({"certificate": made.certificate, "key": made.key}, f"{made.certificate}\n{made.key}")


@contextmanager
def _refusals(remedy: str) -> Iterator[None]:
    """Says why files cannot be made; `remedy`, what makes a file that is missing."""
    try:
        yield
    except FileExistsError as error:
        raise InvalidArgumentError(
            f"{error.filename} is there already: remove it first, or choose another name"
        ) from None
    except FileNotFoundError as error:
        raise InvalidArgumentError(f"there is no {error.filename}: {remedy}") from None
    except OSError as error:
        raise InvalidArgumentError(f"{error.filename}: {error.strerror}") from None
    except UalError:
        raise
    except ValueError as error:
        raise InvalidArgumentError(str(error)) from None


def _checked(name: str) -> str:
    tokens.require_name(name)
    if name == "authority":  # its files
        raise ValueError(f"{name!r} is no name for it: the authority has that")
    return name


for _command in (authority, daemon, caller, network):
    certificates.add_command(_command)
COMMANDS = (certificates,)
