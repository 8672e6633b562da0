"""The servicers of the services that are shipped with the daemon, beside that of the UAV: unpack, call, pack."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple, Protocol

from ual.access.roles import Role
from ual.v1.gripper_pb2_grpc import add_GripperServiceServicer_to_server
from ual_daemon.extensions.shipped.fence import FencedVehicle
from ual_daemon.extensions.shipped.gripper import EquippedVehicle
from ual_daemon.extensions.shipped.vehicle import CommandedVehicle, GimbalVehicle, LocatedVehicle
from ual_daemon.server.shipped.cameras import camera_service
from ual_daemon.server.shipped.corrections import corrections_service
from ual_daemon.server.shipped.fence import fence_service
from ual_daemon.server.shipped.gimbals import gimbal_service
from ual_daemon.server.shipped.gripper import GripperServicer
from ual_daemon.server.shipped.logs import log_service
from ual_daemon.server.shipped.missions import mission_service
from ual_daemon.server.shipped.parameters import parameter_service


class ShippedService(NamedTuple):
    """One of them, as `ual_daemon.server.server.AddedService`. `access.needed` has their roles."""

    name: str
    add_to_server: Callable[[Any], None]
    roles: Mapping[str, Role] = {}


def _gripper_service(vehicle: EquippedVehicle) -> tuple[str, Callable[[Any], None]]:
    return "ual.v1.GripperService", partial(add_GripperServiceServicer_to_server, GripperServicer(vehicle))


_MAKERS = (
    parameter_service,
    mission_service,
    camera_service,
    gimbal_service,
    fence_service,
    _gripper_service,
    log_service,
    corrections_service,
)
"""What makes each of them for a UAV: its full name, and what registers its servicer."""


class ShippedVehicle(FencedVehicle, LocatedVehicle, GimbalVehicle, CommandedVehicle, EquippedVehicle, Protocol):
    """What all of them need of their UAV."""


def services(vehicle: ShippedVehicle) -> Sequence[ShippedService]:
    """Returns all of them for a UAV. Each refuses with NOT_SUPPORTED what its backend does not offer."""
    return [ShippedService(*make(vehicle)) for make in _MAKERS]
