"""The servicers of the services that are shipped with the daemon, besides that of the UAV: unpack, call, pack."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

from ual.access.roles import Role
from ual_daemon.server.services.table import SERVICES
from ual_daemon.services._derived import ServicesVehicle


class ServiceEntry(NamedTuple):
    """One of them, as `ual_daemon.server.server.AddedService`. `access.needed` has their roles."""

    name: str
    add_to_server: Callable[[Any], None]
    roles: Mapping[str, Role] = {}


def services(vehicle: ServicesVehicle) -> Sequence[ServiceEntry]:
    """Returns all of them for a UAV. Each refuses with NOT_SUPPORTED what its backend does not offer."""
    return [ServiceEntry(name, partial(add, make(vehicle))) for name, add, make in SERVICES]
