"""The services beside that of the UAV as Python has them: classes of `ual.interface`, with a member for a method."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from google.protobuf.descriptor_pb2 import (
    DescriptorProto,
    FieldDescriptorProto,
    FileDescriptorProto,
    FileDescriptorSet,
    MethodDescriptorProto,
    ServiceDescriptorProto,
)

from tools.contract import by_hand
from tools.contract.compiled import ROOT
from tools.contract.options import Options
from tools.contract.python_source import classes, functions
from tools.contract.words import snake

CLIENT = ROOT / "clients" / "python" / "ual"
INTERFACE = CLIENT / "interface.py"
_STREAMED = (3, 4)
"""The kinds of setpoints and of poses from outside."""
_OTHERS = ("UalService", "SimulationService", "NetworkService")


@dataclass(frozen=True)
class PartMember:
    """A member of a part: its signature and documentation, and the method that it calls; None where by hand."""

    name: str
    signature: ast.arguments
    returned: str
    documentation: str
    method: MethodDescriptorProto | None
    request: DescriptorProto | None
    response: DescriptorProto | None
    needs_lease: bool
    is_streamed: bool
    """Whether its values go in a stream of the client's, whose calls are by hand."""

    @property
    def arguments(self) -> list[ast.arg]:
        """Its arguments, without itself and how long the caller waits."""
        return [each for each in (*self.signature.args[1:], *self.signature.kwonlyargs) if each.arg != "timeout_s"]

    @property
    def is_stream(self) -> bool:
        """Whether it returns an iterator."""
        return self.returned.startswith("Iterator[")

    @property
    def function(self) -> str:
        """The name of the function that makes its call."""
        return f"{self.name}_" if self.name in ("set", "print", "open") else self.name

    def passed(self) -> str:
        """Returns the arguments of a call that passes all of them on, by name where they could be mixed up."""
        names = [each.arg for each in self.arguments]
        if len(self.signature.args) == 2 and not self.signature.kwonlyargs:
            return names[0]
        return ", ".join(f"{name}={name}" for name in names)


@dataclass(frozen=True)
class ContractPart:
    """A class of `ual.interface`, of a service. `bound` is the field that names one of several."""

    name: str
    service: str
    file: str
    members: Sequence[PartMember]
    bound: str
    of_each: str
    """The class of one of several, which this part has by their numbers; else empty."""

    @property
    def module(self) -> str:
        """Name of its modules."""
        return snake(self.name)


def parts(contract: FileDescriptorSet) -> list[ContractPart]:
    """Returns the parts, in the order of their files: one of several before the class that has them."""
    options = Options(contract)
    return [part for file in contract.file for service in file.service for part in _parts(options, file, service)]


def simulation(contract: FileDescriptorSet) -> ContractPart:
    """Returns the world around a simulated UAV, which has no behaviour in ``ual_daemon.services``."""
    return whole(contract, "Simulation", "SimulationService")


def uav(contract: FileDescriptorSet) -> ContractPart:
    """Returns the UAV itself, with those of its members that are one call each."""
    return whole(contract, "Uav", "UalService")


def whole(contract: FileDescriptorSet, name: str, service: str, interface: Path = INTERFACE) -> ContractPart:
    """Returns a part with those members of a class that are methods of a service."""
    [(file, found)] = [(file, each) for file in contract.file for each in file.service if each.name == service]
    messages = {f".{file.package}.{each.name}": each for file in contract.file for each in file.message_type}
    members = _Members(Options(contract), found, messages, interface).called(name)
    return ContractPart(name, service, Path(file.name).stem, members, "", "")


def _parts(options: Options, file: FileDescriptorProto, service: ServiceDescriptorProto) -> list[ContractPart]:
    file_name = Path(file.name).stem
    if service.name in _OTHERS or file_name in by_hand.FILES:
        return []
    facts = options.read("Service", "service_facts", service.options)
    name = facts.part or service.name.removesuffix("Service")
    messages = {f".{file.package}.{each.name}": each for each in file.message_type}
    made = _Members(options, service, messages)
    if not facts.each:
        return [ContractPart(name, service.name, file_name, made.members(name), "", "")]
    bound = snake(facts.each)
    each = ContractPart(facts.each, service.name, file_name, made.members(facts.each, bound), bound, "")
    return [each, ContractPart(name, service.name, file_name, made.members(name, without=bound), "", facts.each)]


class _Members:
    def __init__(
        self,
        options: Options,
        service: ServiceDescriptorProto,
        messages: dict[str, DescriptorProto],
        interface: Path = INTERFACE,
    ) -> None:
        self._interface = interface
        self._service = service
        self._messages = messages
        self._options = options

    def members(self, name: str, bound: str = "", without: str = "") -> list[PartMember]:
        found = classes(INTERFACE).get(name)
        if found is None:
            raise SystemExit(f"ual.interface has no class {name}, for {self._service.name}")
        methods = {self._name_of(each): each for each in self._service.method if self._belongs(each, bound, without)}
        declared = functions(found)
        if missing := set(methods) - set(declared):
            raise SystemExit(f"ual.interface.{name} has no {', '.join(sorted(missing))}, for {self._service.name}")
        return [self._member(node, methods.get(node.name)) for node in declared.values()]

    def called(self, name: str) -> list[PartMember]:
        """Returns the members of a class that are called as methods."""
        methods = {self._name_of(each): each for each in self._service.method}
        declared = functions(classes(self._interface)[name])
        return [self._member(each, methods[each.name]) for each in declared.values() if each.name in methods]

    def _facts(self, method: MethodDescriptorProto) -> Any:  # noqa: ANN401 (a message that is made at run time)
        return self._options.read("Method", "facts", method.options)

    def _name_of(self, method: MethodDescriptorProto) -> str:
        member: str = self._facts(method).member
        return member or snake(method.name)

    def _belongs(self, method: MethodDescriptorProto, bound: str, without: str) -> bool:
        fields: Sequence[FieldDescriptorProto] = self._messages[method.input_type].field
        first = fields[0].name if fields else ""
        return first == bound if bound else first != without or not without

    def _member(self, node: ast.FunctionDef, method: MethodDescriptorProto | None) -> PartMember:
        return PartMember(
            node.name,
            node.args,
            "" if node.returns is None else ast.unparse(node.returns),
            ast.get_docstring(node) or "",
            method,
            None if method is None else self._messages[method.input_type],
            None if method is None else self._messages[method.output_type],
            method is not None and self._facts(method).lease,
            method is not None and (method.client_streaming or self._facts(method).kind in _STREAMED),
        )
