"""Writes ``ual_daemon/services/_derived.py``: the services of a UAV in the process."""

from __future__ import annotations

import ast
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from tools.contract.behaviour import ROOM, Behaviour, behaviour
from tools.contract.parts import INTERFACE, ContractPart, PartMember
from tools.contract.python_source import classes, functions, imports, names_in

_HEAD = '''"""The services of a UAV in this process. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Protocol

from typing_extensions import override

from ual import interface
'''
_LATER = """
if TYPE_CHECKING:
    from ual_daemon.choice import ServedVehicle as CommandedUav
"""


def source(parts: Sequence[ContractPart], uav: ContractPart | None = None) -> str:
    """Returns the module. `uav` has the members of the UAV itself."""
    owners = {each.service: each for each in parts if not each.bound}
    done = {service: behaviour(owner) for service, owner in owners.items()}
    body = "".join(_face(each, done[each.service]) for each in parts) + _all(owners.values(), done)
    body += "" if uav is None else _of_uav(uav)
    used = names_in(body)
    vehicles = "".join(imports(each.path, {each.vehicle}) for each in done.values())
    helpers = sorted({"answer", "answers"} & used)
    return (
        _HEAD
        + imports(INTERFACE, used - {"Callable", "Iterator", "Protocol"})
        + "".join(f"from {each.module} import {name}\n" for each in done.values() for name in each.named(used))
        + vehicles
        + f"from ual_daemon.services.answers import {', '.join(helpers)}\n"
        + _LATER
        + body
    )


def _all(owners: Collection[ContractPart], done: Mapping[str, Behaviour]) -> str:
    """Returns the class of all services' needs of a vehicle, and the members of `ual_daemon.UAL` that return them."""
    vehicles = ", ".join(sorted({each.vehicle for each in done.values()} - {"ServedVehicle"}))
    made = "".join(
        f"        self.{each.module} = {each.name}(vehicle{', lease_id' * done[each.service].is_leased})\n"
        for each in owners
    )
    members = "".join(
        f"\n    @property\n    @override\n    def {each.module}(self) -> {each.name}:\n"
        f"        return self._parts.{each.module}\n"
        for each in owners
    )
    return f'''

class ServicesVehicle({vehicles}, Protocol):
    """Needs of all services of their UAV."""


class Parts:
    """The services of a UAV."""

    def __init__(self, vehicle: ServicesVehicle, lease_id: Callable[[], str]) -> None:
{made}

class PartMembers(interface.Uav):
    """The members of `ual_daemon.UAL` that return its services."""

    @property
    @abstractmethod
    def _parts(self) -> Parts:
        """The services, unless this object is closed."""
{members}'''


def _of_uav(uav: ContractPart) -> str:
    """Returns the members of a UAV that its vehicle has, and those that pass the lease to a command of it."""
    by_hand = {getattr(each, "name", "") for each in classes(_CLASS)["UAL"].body}
    members = "".join(_passed(each) for each in uav.members if each.name not in by_hand)
    return f'''

class UavMembers(interface.Uav):
    """The members of `ual_daemon.UAL` that only pass on to its vehicle."""

    _lease_id: str

    @property
    @abstractmethod
    def _open(self) -> CommandedUav:
        """The vehicle, unless this object is closed."""
{members}'''


def _passed(member: PartMember) -> str:
    arguments = [f"{each.arg}={each.arg}" for each in member.arguments]
    arguments += ["lease_id=self._lease_id"] * member.needs_lease
    call = f"self._open{'.commands' * member.needs_lease}.{member.name}({', '.join(arguments)})"
    returned = call if member.returned == "None" else f"return {call}"
    head = f"def {member.name}({ast.unparse(member.signature)}) -> {member.returned}:"
    return f"\n    @override\n    {head}\n        {returned}\n"


def _face(part: ContractPart, does: Behaviour) -> str:
    by_hand = _base(does.path, f"{part.name}Base")
    bases = f"{part.name}Base, interface.{part.name}" if by_hand else f"interface.{part.name}"
    members = "".join(_member(part, does, each) for each in part.members if each.name not in by_hand)
    head = f'class {part.name}({bases}):\n    """`ual.interface.{part.name}`, in this process."""'
    return f"\n\n{head}\n{_made(part, does)}{members}"


def _base(path: Path, name: str) -> set[str]:
    found = classes(path).get(name)
    return set() if found is None else set(functions(found))


def _made(part: ContractPart, does: Behaviour) -> str:
    if part.bound:
        return (
            f"\n    def __init__(self, of_vehicle: {does.name}, number: int) -> None:\n"
            "        self._of_vehicle = of_vehicle\n        self._number = number\n\n"
            f'    def __repr__(self) -> str:\n        return f"<{part.name} {{self._number}}>"\n'
        )
    lease = ", lease_id: Callable[[], str]" if does.is_leased else ""
    kept = "        self._lease_id = lease_id\n" if does.is_leased else ""
    made = (
        f"\n    def __init__(self, vehicle: {does.vehicle}{lease}) -> None:\n"
        f"        self._of_vehicle = {does.name}(vehicle)\n{kept}"
    )
    return made + _numbered(part) if part.of_each else made


def _numbered(part: ContractPart) -> str:
    return (
        f"\n    @override\n    def __getitem__(self, number: int) -> {part.of_each}:\n"
        f"        return {part.of_each}(self._of_vehicle, number)\n"
        f"\n    @override\n    def __iter__(self) -> Iterator[{part.of_each}]:\n"
        "        return (self[each.number] for each in self.get_all())\n"
    )


def _member(part: ContractPart, does: Behaviour, member: PartMember) -> str:
    if member.method is None:
        raise SystemExit(f"{part.name}.{member.name} is no method: {does.module}.{part.name}Base lacks it")
    arguments = ["self._number"] * bool(part.bound)
    arguments += [f"{each.arg}={each.arg}" for each in member.arguments]
    arguments += ["lease_id=self._lease_id()"] * does.takes_lease(member)
    call = f"self._of_vehicle.{member.name}({', '.join(arguments)})"
    if member.is_stream or does.waits(member):
        call = f'{"answers" if member.is_stream else "answer"}({call}, "{member.method.name}")'
    returned = call if member.returned == "None" else f"return {call}"
    head = f"def {member.name}({ast.unparse(member.signature)}) -> {member.returned}:"
    return f"\n    @override\n    {head}\n        {returned}\n"


PATH = ROOM / "_derived.py"
_CLASS = ROOM.parent / "ual.py"
