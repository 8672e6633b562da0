"""Gets telemetry from all UAVs of this computer at the same time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ual._cli.app import Session
from ual._discovery import Registration
from ual.errors import UalError
from ual.types import Telemetry

_PARALLEL = 16


def ask_all(session: Session, daemons: Sequence[Registration]) -> Iterator[Telemetry | UalError]:
    """Yields one telemetry sample of each UAV in the order of `daemons`, or the error by which there is none."""
    # Imported late: with logging, it would add a tenth to the imports of all other commands.
    from concurrent.futures import ThreadPoolExecutor

    def ask(daemon: Registration) -> Telemetry | UalError:
        try:
            with session.connect_to(daemon) as uav:
                return uav.telemetry()
        except UalError as error:
            return error

    with ThreadPoolExecutor(_PARALLEL) as pool:
        yield from pool.map(ask, daemons)
