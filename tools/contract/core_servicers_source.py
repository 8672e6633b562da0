"""Writes the methods of the UAV's own service and of its simulation that are no more than unpack, call and pack.

Those in the classes by hand, `UalServicer` and `SimulationServicerBase`, are more.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator

from tools.contract import requests
from tools.contract.compiled import ROOT
from tools.contract.parts import ContractPart, PartMember
from tools.contract.python_source import classes, functions, names_in
from tools.contract.servicers_source import ROOM
from tools.contract.values import Values

UAV = ROOM / "uav.py"
SIMULATION = ROOM / "simulation.py"
_SERVER = ROOM.parent
_COMMANDS = ROOT / "ual_daemon" / "vehicle" / "commands.py"


def uav_source(values: Values, part: ContractPart) -> str:
    """Returns the module of the UAV's methods. Those that need the lease are commands of the vehicle."""
    by_hand = _names(classes(_SERVER / "uav_service.py")["UalServicer"])
    commands = functions(classes(_COMMANDS)["Commands"])
    body = ""
    for member in part.members:
        assert member.method is not None
        if member.method.name not in by_hand:
            body += _of_uav(values, member, commands.get(member.name))
    return _module(
        values,
        f'''

class UalServicerBase(ual_pb2_grpc.UalServiceServicer):
    """Methods that the vehicle answers by itself."""

    _vehicle: ServedVehicle
{body}''',
        """from typing import TYPE_CHECKING

""",
        """
if TYPE_CHECKING:
    from ual_daemon.choice import ServedVehicle
""",
    )


def _of_uav(values: Values, member: PartMember, command: ast.FunctionDef | None) -> str:
    assert member.method is not None
    assert member.request is not None
    assert member.response is not None
    named = {part.split("=", 1)[0]: part.split("=", 1)[1] for part in _fields(values, member)}
    arguments = list(named.values()) + ["lease_of(context)"] * member.needs_lease
    call = f"self._vehicle{'.commands' * member.needs_lease}.{member.name}({', '.join(arguments)})"
    response = f"pb.{member.response.name}"
    waits = command is not None and command.returns is not None and ast.unparse(command.returns).startswith("Future[")
    returned = f"Awaitable[{response}]" if waits else response
    head = f"    @override\n    def {member.method.name}(self, request: pb.{member.request.name}, context: object)"
    pack = requests.result(values, member).pack
    if waits:
        answer = f"        return after({call}, {pack})\n"
    elif "result" in pack:
        answer = f"        result = {call}\n        return {pack}\n"
    else:
        answer = f"        {call}\n        return {pack}\n"
    return f"\n{head} -> {returned}:\n{answer}"


def _fields(values: Values, member: PartMember) -> Iterator[str]:
    """Yields the fields of a request. Of an interface's member they may be more than the arguments."""
    assert member.request is not None
    return (f"{each.name}={requests.read_field(values, each)}" for each in member.request.field)


def simulation_source(values: Values, part: ContractPart) -> str:
    """Returns the module of a simulation's methods. Its members may block: each is called in a thread."""
    by_hand = _names(classes(_SERVER / "simulation_service.py")["SimulationServicerBase"])
    body = "".join(
        _of_simulation(values, part, each) for each in part.members if each.method and each.method.name not in by_hand
    )
    return _module(
        values,
        f'''

class SimulationServicer(SimulationServicerBase):
    """The interface of one simulation. ``ual/v1/simulation.proto`` describes each method."""
{body}''',
        "",
        "from ual_daemon.server.simulation_service import SimulationServicerBase\n",
    )


def _of_simulation(values: Values, part: ContractPart, member: PartMember) -> str:
    assert member.method is not None
    assert member.request is not None
    assert member.response is not None
    arguments = ", ".join((f"self._simulation.{member.name}", *requests.read(values, part, member)))
    pack = requests.result(values, member).pack
    call = f"{'result = ' * ('result' in pack)}await self._act({arguments})"
    head = f"async def {member.method.name}(self, request: pb.{member.request.name}, context: object)"
    return f"\n    @override\n    {head} -> pb.{member.response.name}:\n        {call}\n        return {pack}\n"


def _module(values: Values, body: str, first: str, last: str) -> str:
    used = names_in(body)
    grpc = f"{values.file}_pb2_grpc"
    codecs = [each for each in ("convert", "samples") if each in used]
    return (
        '"""Methods that are unpack, call and pack. ``make proto`` writes this file: do not edit it."""\n\n'
        "from __future__ import annotations\n\n"
        + "from collections.abc import Awaitable\n" * ("Awaitable" in used)
        + f"{first}from typing_extensions import override\n\nfrom ual.v1 import {values.file}_pb2 as pb\n"
        + f"from ual.v1 import {grpc}\n" * (grpc in used)
        + "".join(f"from ual.wire import {each}\n" for each in codecs)
        + f"from ual.wire import {values.wire} as wire\n" * ("wire" in used)
        + "from ual_daemon.extensions.base import lease_of\n" * ("lease_of" in used)
        + "from ual_daemon.server.waiting import after\n" * ("after" in used)
        + last
        + body
    )


def _names(owner: ast.ClassDef) -> set[str]:
    return {getattr(each, "name", "") for each in owner.body}
