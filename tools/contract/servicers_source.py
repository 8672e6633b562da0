"""Writes the servicers of ``ual_daemon/server/services``: unpack, call, pack."""

from __future__ import annotations

from collections.abc import Sequence

from tools.contract import requests
from tools.contract.behaviour import Behaviour, behaviour
from tools.contract.compiled import ROOT
from tools.contract.parts import ContractPart, PartMember
from tools.contract.python_source import classes, imports, names_in
from tools.contract.values import Values
from tools.contract.words import snake

ROOM = ROOT / "ual_daemon" / "server" / "services"
BY_HAND = ROOM / "by_hand.py"
"""The methods that are more than unpack, call and pack: ``XServiceBase`` is a base of the servicer of ``XService``."""


def source(values: Values, parts: Sequence[ContractPart]) -> str:
    """Returns the module of a service, of its one or two parts."""
    [owner] = [each for each in parts if not each.bound]
    does, service = behaviour(owner), owner.service
    base = classes(BY_HAND).get(f"{service}Base")
    by_hand = set() if base is None else {getattr(each, "name", "") for each in base.body}
    methods = [
        (part, each) for part in parts for each in part.members if each.method and each.method.name not in by_hand
    ]
    bodies = "".join(_method(values, does, part, member) for part, member in methods)
    grpc = f"{owner.file}_pb2_grpc"
    bases = f"{service}Base, {grpc}.{service}Servicer" if by_hand else f"{grpc}.{service}Servicer"
    body = f'''

class {service.removesuffix("Service")}Servicer({bases}):
    """The methods of `{service}` for one UAV. ``ual/v1/{owner.file}.proto`` describes each of them."""

    def __init__(self, vehicle: {does.vehicle}) -> None:
        self._of_vehicle = {does.name}(vehicle)
{bodies}'''
    return _head(owner, does, body, f"{service}Base" * bool(by_hand)) + body


def _head(owner: ContractPart, does: Behaviour, body: str, base: str) -> str:
    used = names_in(body)
    helpers = sorted({"answer", "answers"} & used)
    return (
        f'"""`{owner.service}`: unpack, call, pack. ``make proto`` writes this file: do not edit it."""\n\n'
        "from __future__ import annotations\n\n"
        + "import asyncio\n" * ("asyncio" in used)
        + "from collections.abc import AsyncIterator\n" * ("AsyncIterator" in used)
        + "\nfrom typing_extensions import override\n\n"
        f"from ual.v1 import {owner.file}_pb2 as pb\nfrom ual.v1 import {owner.file}_pb2_grpc\n"
        + f"from ual.wire import {owner.file} as wire\n" * ("wire" in used)
        + "from ual.wire import convert\n" * ("convert" in used)
        + "from ual.wire import uav\n" * ("uav" in used)
        + "from ual.wire import requests\n" * ("requests" in used)
        + "from ual_daemon.extensions.base import lease_of\n" * ("lease_of" in used)
        + f"from {does.module} import {', '.join(does.named({does.name, does.vehicle}))}\n"
        + imports(does.path, {does.vehicle})
        + (f"from ual_daemon.server.services.by_hand import {base}\n" if base else "")
        + (f"from ual_daemon.server.services.waiting import {', '.join(helpers)}\n" if helpers else "")
    )


def _method(values: Values, does: Behaviour, part: ContractPart, member: PartMember) -> str:
    assert member.method is not None
    assert member.request is not None
    assert member.response is not None
    name, response = member.method.name, f"pb.{member.response.name}"
    arguments = f"self, request: pb.{member.request.name}, context: object"
    returned = f"AsyncIterator[{response}]" if member.is_stream else response
    return f"\n    @override\n    async def {name}({arguments}) -> {returned}:\n{_answer(values, does, part, member)}"


def _answer(values: Values, does: Behaviour, part: ContractPart, member: PartMember) -> str:
    assert member.method is not None
    if requests.is_special(member):
        arguments = [f"**requests.{snake(member.method.name)}_arguments(request)"]
    else:
        arguments = list(requests.read(values, part, member))
    arguments += ["lease_id=lease_of(context)"] * does.takes_lease(member)
    called = f"self._of_vehicle.{member.name}({', '.join(arguments)})"
    pack, name = requests.result(values, member).pack, member.method.name
    if member.is_stream:
        return f'        async for result in answers({called}, "{name}"):\n            yield {pack}\n'
    if does.is_in_thread(member):
        if not does.waits(member):
            return (
                f"        def made() -> pb.{member.method.output_type.rpartition('.')[2]}:\n"
                f"            result = {called}\n            return {pack}\n\n"
                "        return await asyncio.to_thread(made)\n"
            )
        called = f"await asyncio.to_thread(lambda: {called})"
    if does.waits(member):
        called = f'await answer({called}, "{name}")'
    if "result" not in pack:
        return f"        {called}\n        return {pack}\n"
    return f"        result = {called}\n        return {pack}\n"


def table_source(parts: Sequence[ContractPart]) -> str:
    """Returns the module that lists the servicers."""
    owners = [each for each in parts if not each.bound]
    rows, lines = "", ""
    for each in owners:
        grpc, servicer = f"{each.file}_pb2_grpc", f"{each.service.removesuffix('Service')}Servicer"
        lines += f"from ual_daemon.server.services.{each.file} import {servicer}\n"
        rows += f'    ("ual.v1.{each.service}", {grpc}.add_{each.service}Servicer_to_server, {servicer}),\n'
    modules = ", ".join(f"{each.file}_pb2_grpc" for each in owners)
    return (
        '"""The servicers of all services. ``make proto`` writes this file: do not edit it."""\n\n'
        "from __future__ import annotations\n\n"
        "from collections.abc import Callable, Sequence\nfrom typing import Any\n\n"
        f"from ual.v1 import {modules}\n{lines}\n"
        f"SERVICES: Sequence[tuple[str, Callable[..., None], Callable[[Any], object]]] = (\n{rows})\n"
        '"""The name of each, what registers its servicer, and what makes that for a vehicle."""\n'
    )
