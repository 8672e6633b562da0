"""Role that each method needs."""

from __future__ import annotations

from collections.abc import Mapping

from ual.access.roles import Role
from ual.contract.methods import METHODS, ROLE_OF_UNKNOWN

_OF_METHOD: Mapping[str, Role] = {each.path[1:]: each.role for each in METHODS.values()}
_OF_SERVICE: Mapping[str, Role] = {
    **ROLE_OF_UNKNOWN,
    "grpc.health.v1.Health": Role.OBSERVER,
    "grpc.reflection.v1alpha.ServerReflection": Role.OBSERVER,
}


def needed_role(method: str) -> Role:
    """Returns the role that ``/package.Service/Method`` needs; for a service that is not ours (an extension) pilot."""
    name = method.lstrip("/")
    return _OF_METHOD.get(name) or _OF_SERVICE.get(name.partition("/")[0], Role.PILOT)
