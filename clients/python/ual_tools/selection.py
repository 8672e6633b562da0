"""The UAVs of this computer that were chosen, and telemetry from all of them at the same time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ual.discovery import Registration
from ual.errors import DaemonUnreachableError, UalError
from ual.types import Telemetry
from ual_tools import multi
from ual_tools.session import CommandSession

_PARALLEL_CALLS_COUNT = 16


def chosen_daemons(session: CommandSession) -> list[Registration]:
    """Returns the daemons of this computer, or of the network: with ``--ns a,b`` those with these names, else all.

    With names and an address, which is then a gateway's or that of the only one, they are behind it.
    """
    names = multi.names(session) if session.ns else None
    if session.ns and session.address:
        return [Registration(name, 0, session.address, "", 0.0) for name in names or [session.ns]]
    daemons = session.daemons()
    return daemons if names is None else [daemon for daemon in daemons if daemon.ns in names]


def several(session: CommandSession) -> list[Registration] | None:
    """Returns the daemons where several UAVs are chosen; None for a single one.

    Raises:
        DaemonUnreachableError: One that is named does not run on this computer, or is not on the network.

    """
    names = multi.names(session)
    if names is None:
        return None
    daemons = chosen_daemons(session)
    missing = set(names) - {daemon.ns for daemon in daemons}
    if missing:
        raise DaemonUnreachableError(f"no daemon of the name {', '.join(sorted(missing))} {session.where}")
    return daemons


def ask_all(session: CommandSession, daemons: Sequence[Registration]) -> Iterator[Telemetry | UalError]:
    """Yields one telemetry sample of each UAV in the order of `daemons`, or the error by which there is none."""
    # Imported late: with logging, it would add a tenth to the imports of all other commands.
    from concurrent.futures import ThreadPoolExecutor

    def ask(daemon: Registration) -> Telemetry | UalError:
        try:
            with session.connect_to(daemon) as uav:
                return uav.telemetry()
        except UalError as error:
            return error

    with ThreadPoolExecutor(_PARALLEL_CALLS_COUNT) as pool:
        yield from pool.map(ask, daemons)
