"""Handwritten behaviour of a service in the daemon: the class ``VehicleX`` of the part ``X``."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from pathlib import Path

from tools.contract.compiled import ROOT
from tools.contract.parts import ContractPart, PartMember
from tools.contract.python_source import classes, functions

ROOM = ROOT / "ual_daemon" / "services"


@dataclass(frozen=True)
class Behaviour:
    """The class of a service, and the type of its vehicle."""

    name: str
    module: str
    vehicle: str
    methods: dict[str, ast.FunctionDef]

    def method(self, member: PartMember) -> ast.FunctionDef:
        """Returns what serves a member.

        Raises:
            SystemExit: It is not there.

        """
        if member.name not in self.methods:
            raise SystemExit(f"{self.module}.{self.name} has no {member.name}")
        return self.methods[member.name]

    def waits(self, member: PartMember) -> bool:
        """Returns whether it returns a future."""
        returned = self.method(member).returns
        return returned is not None and ast.unparse(returned).startswith("Future[")

    def is_in_thread(self, member: PartMember) -> bool:
        """Returns whether it is declared to take long before it returns, and so to be called beside the event loop."""
        return any(ast.unparse(each) == "in_thread" for each in self.method(member).decorator_list)

    def takes_lease(self, member: PartMember) -> bool:
        """Returns whether it takes the lease of its caller, as the contract says of the method.

        Raises:
            SystemExit: It does not agree with the contract.
        """
        arguments = self.method(member).args
        takes = "lease_id" in {each.arg for each in (*arguments.args, *arguments.kwonlyargs)}
        if takes != member.needs_lease:
            text = (
                "takes none, and the contract asks for it"
                if member.needs_lease
                else "takes it, and the contract does not ask"
            )
            raise SystemExit(f"the lease: {self.module}.{self.name}.{member.name} {text}")
        return takes

    @property
    def is_leased(self) -> bool:
        """Whether any of its methods takes a lease."""
        return any("lease_id" in ast.unparse(each.args) for each in self.methods.values())

    def named(self, used: set[str]) -> list[str]:
        """Returns the classes of its module that a source uses."""
        return sorted(used & set(classes(self.path)))

    @property
    def path(self) -> Path:
        """Path of the module."""
        return ROOT / f"{self.module.replace('.', '/')}.py"


def behaviour(service: ContractPart) -> Behaviour:
    """Returns what a service does. `service` is its part, or the one that has several."""
    path = ROOM / f"{service.module}.py"
    name = f"Vehicle{service.name}"
    found = classes(path).get(name)
    if found is None:
        raise SystemExit(f"{path.relative_to(ROOT)} has no class {name}")
    made = next(each for each in found.body if isinstance(each, ast.FunctionDef) and each.name == "__init__")
    vehicle = made.args.args[1].annotation
    module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    return Behaviour(name, module, "object" if vehicle is None else ast.unparse(vehicle), functions(found))
