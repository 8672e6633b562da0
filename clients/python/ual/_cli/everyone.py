"""All UAVs of this computer, asked at the same time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ual._cli.app import Session
from ual._discovery import Registration
from ual.errors import UalError
from ual.types import Telemetry

_PARALLEL = 16


def ask_all(session: Session, daemons: Sequence[Registration]) -> Iterator[Telemetry | UalError]:
    """A sample of each, in their order, or why there is none."""
    from concurrent.futures import ThreadPoolExecutor  # with logging: a tenth of what any other command imports

    def ask(daemon: Registration) -> Telemetry | UalError:
        try:
            with session.connect_to(daemon) as uav:
                return uav.telemetry()
        except UalError as error:
            return error

    with ThreadPoolExecutor(_PARALLEL) as pool:
        yield from pool.map(ask, daemons)
