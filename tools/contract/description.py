"""The services of the contract as the generators read them, with what the options say of their methods."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from google.protobuf.descriptor_pb2 import FileDescriptorSet, MethodDescriptorProto, ServiceDescriptorProto

from tools.contract.options import Options
from ual.access.roles import Role
from ual.contract.method import QUICK_S, Kind, Method, Moves


@dataclass(frozen=True)
class ContractService:
    """A service, and its methods in the order of the contract."""

    name: str
    role_of_unknown: Role
    methods: tuple[Method, ...]


def services(contract: FileDescriptorSet) -> list[ContractService]:
    """Returns the services, that of the UAV first.

    Raises:
        SystemExit: A method does not say which role may call it, or two have one name.

    """
    options = Options(contract)
    found = [_service(options, each) for file in contract.file for each in file.service]
    _require_distinct([each.name for service in found for each in service.methods])
    return sorted(found, key=lambda each: (each.name != "UalService", each.name))


def _service(options: Options, service: ServiceDescriptorProto) -> ContractService:
    facts = options.read("Service", "service_facts", service.options)
    methods = tuple(_method(options, service.name, each, facts.at_timeout) for each in service.method)
    return ContractService(service.name, Role(facts.role), methods)


def _method(options: Options, service: str, method: MethodDescriptorProto, at_timeout: str) -> Method:
    facts = options.read("Method", "facts", method.options)
    role = Role(facts.role)
    if role is Role.NONE:
        raise SystemExit(f"{service}.{method.name} does not say who may call it: option (facts) = {{role: …}}")
    is_change = role is not Role.OBSERVER
    return Method(
        service,
        method.name,
        role,
        _kind(service, facts.kind, is_change=is_change),
        Moves(facts.moves),
        facts.lease,
        facts.stale_after_s or math.inf,
        facts.limit_s or math.inf,
        _caller_limit_s(facts),
        facts.at_timeout if facts.HasField("at_timeout") else at_timeout * is_change,
        facts.audited if facts.HasField("audited") else is_change,
        facts.flies_on,
    )


def _kind(service: str, number: int, *, is_change: bool) -> Kind:
    if service == "SimulationService":
        return Kind.SIMULATION
    named = {1: Kind.COMMAND, 2: Kind.STOP, 3: Kind.SETPOINT, 4: Kind.EXTERNAL_POSE}
    return named.get(number, Kind.CHANGE if is_change else Kind.QUESTION)


def _caller_limit_s(facts: Any) -> float | None:  # noqa: ANN401 (a message that is made at run time)
    limit_s: float = facts.caller_limit_s if facts.HasField("caller_limit_s") else QUICK_S
    return None if limit_s == math.inf else limit_s


def _require_distinct(names: Sequence[str]) -> None:
    if twice := sorted({each for each in names if names.count(each) > 1}):
        raise SystemExit(f"two methods of the contract are called {', '.join(twice)}")
