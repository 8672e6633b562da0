"""Writes ``ual_daemon/extensions/shipped/derived.py``: the services of a UAV in the process."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from pathlib import Path

from tools.contract.behaviour import ROOM, Behaviour, behaviour
from tools.contract.parts import INTERFACE, Member, Part
from tools.contract.python_source import classes, functions, imports, names_in

_HEAD = '''"""The services of a UAV in this process. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from typing_extensions import override

from ual import interface
'''


def source(parts: Sequence[Part]) -> str:
    """Returns the module."""
    owners = {each.service: each for each in parts if not each.bound}
    done = {service: behaviour(owner) for service, owner in owners.items()}
    body = "".join(_face(each, done[each.service]) for each in parts)
    used = names_in(body)
    vehicles = "".join(_vehicle_import(each) for each in done.values())
    helpers = sorted({"answer", "answers"} & used)
    return (
        _HEAD
        + imports(INTERFACE, used - {"Callable", "Iterator"})
        + "".join(f"from {each.module} import {each.name}\n" for each in done.values())
        + vehicles
        + f"from ual_daemon.extensions.shipped.answers import {', '.join(helpers)}\n"
        + body
    )


def _vehicle_import(does: Behaviour) -> str:
    own = classes(does.path)
    return f"from {does.module} import {does.vehicle}\n" if does.vehicle in own else imports(does.path, {does.vehicle})


def _face(part: Part, does: Behaviour) -> str:
    by_hand = _base(does.path, f"{part.name}Base")
    bases = f"{part.name}Base, interface.{part.name}" if by_hand else f"interface.{part.name}"
    members = "".join(_member(part, does, each) for each in part.members if each.name not in by_hand)
    head = f'class {part.name}({bases}):\n    """`ual.interface.{part.name}`, in this process."""'
    return f"\n\n{head}\n{_made(part, does)}{members}"


def _base(path: Path, name: str) -> set[str]:
    found = classes(path).get(name)
    return set() if found is None else set(functions(found))


def _made(part: Part, does: Behaviour) -> str:
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


def _numbered(part: Part) -> str:
    return (
        f"\n    @override\n    def __getitem__(self, number: int) -> {part.of_each}:\n"
        f"        return {part.of_each}(self._of_vehicle, number)\n"
        f"\n    @override\n    def __iter__(self) -> Iterator[{part.of_each}]:\n"
        "        return (self[each.number] for each in self.get_all())\n"
    )


def _member(part: Part, does: Behaviour, member: Member) -> str:
    arguments = ["self._number"] * bool(part.bound)
    arguments += [f"{each.arg}={each.arg}" for each in member.arguments]
    arguments += ["lease_id=self._lease_id()"] * does.takes_lease(member)
    call = f"self._of_vehicle.{member.name}({', '.join(arguments)})"
    if member.is_stream or does.waits(member):
        what = member.method.name if member.method is not None else member.name
        call = f'{"answers" if member.is_stream else "answer"}({call}, "{what}")'
    returned = call if member.returned == "None" else f"return {call}"
    head = f"def {member.name}({ast.unparse(member.signature)}) -> {member.returned}:"
    return f"\n    @override\n    {head}\n        {returned}\n"


PATH = ROOM / "derived.py"
