"""Writes the modules of ``ual/_service_calls``: the call of each member of a service, for both clients."""

from __future__ import annotations

import ast
from collections.abc import Mapping

from tools.contract import requests
from tools.contract.parts import CLIENT, INTERFACE, ContractPart, PartMember
from tools.contract.python_source import functions, imports, names_in, parsed
from tools.contract.values import Values
from tools.contract.words import snake

BY_HAND = CLIENT / "_service_calls" / "by_hand.py"
"""The calls that are more than a request and its response: ``fence_upload`` is that of ``Fence.upload``."""


def source(values: Values, part: ContractPart) -> str:
    """Returns the module of a part."""
    by_hand = functions(parsed(BY_HAND))
    mine = {each.name: f"{part.module}_{each.name}" for each in part.members}
    special = {name: function for name, function in mine.items() if function in by_hand}
    unary = [each for each in part.members if not (each.method and each.method.client_streaming)]
    calls = "".join(_call(values, part, each) for each in unary if each.name not in special)
    members = "".join(f'    "{each.name}": {each.function},\n' for each in unary)
    named = "".join(f"{name} = {function}\n" for name, function in special.items())
    body = f"\n{named}{calls}\n\nMEMBERS: Mapping[str, Callable[..., Call[Any]]] = {{\n{members}}}\n"
    return f"{_head(values, part, body, sorted(special.values()))}{body}"


def stubs_source(services: Mapping[str, str]) -> str:
    """Returns the module that has the stub of each service, by its name. `services` has their files."""
    stubs = "".join(f'    "{name}": {file}_pb2_grpc.{name}Stub,\n' for name, file in services.items())
    modules = ", ".join(sorted({f"{file}_pb2_grpc" for file in services.values()}))
    return (
        '"""The stubs of the services. ``make proto`` writes this file: do not edit it."""\n\n'
        "from __future__ import annotations\n\n"
        "from collections.abc import Callable, Mapping\nfrom typing import Any\n\n"
        f"from ual.v1 import {modules}\n\nSTUBS: Mapping[str, Callable[[Any], Any]] = {{\n{stubs}}}\n"
    )


def _head(values: Values, part: ContractPart, body: str, special: list[str]) -> str:
    used = names_in(body)
    calls = sorted({"Call", "built", "nothing", "of", "request"} & used)
    return (
        f'"""The calls of `ual.interface.{part.name}`. ``make proto`` writes this file: do not edit it."""\n\n'
        "from __future__ import annotations\n\n"
        "from collections.abc import Callable, Mapping\n"
        "from typing import Any\n\n"
        f"from ual._calls import {', '.join(calls)}\n"
        + (f"from ual._service_calls.by_hand import {', '.join(special)}\n" if special else "")
        + "from ual.geometry import stamped_point\n" * ("stamped_point" in used)
        + imports(INTERFACE, used - {"stamped_point", "Callable", "Any"})
        + f"from ual.v1 import {values.file}_pb2 as pb\n" * ("pb" in used)
        + f"from ual.wire import {values.file} as wire\n" * ("wire" in used)
        + "from ual.wire import convert\n" * ("convert" in used)
        + "from ual.wire import uav\n" * ("uav" in used)
        + "from ual.wire import requests\n" * ("requests" in used)
    )


def _call(values: Values, part: ContractPart, member: PartMember) -> str:
    if member.method is None or member.request is None:
        raise SystemExit(f"{part.name}.{member.name} is no method: {BY_HAND.name} lacks {part.module}_{member.name}")
    arguments = [f"{part.bound}: int"] if part.bound else []
    arguments += [f"{each.arg}: {ast.unparse(each.annotation)}" for each in member.arguments if each.annotation]
    name = member.method.name
    if requests.is_special(member):
        passed = ", ".join(
            [f"{part.bound}={part.bound}"] * bool(part.bound) + [f"{each.arg}={each.arg}" for each in member.arguments]
        )
        first = member.arguments[0].arg
        request = f'built(lambda: requests.{snake(name)}_request({passed}), "{first}", {first})'
    else:
        fields = list(requests.written(values, part, member))
        request = f"request(pb.{member.request.name}, {', '.join(fields)})" if fields else f"pb.{member.request.name}()"
    read = requests.result(values, member).read
    returned = member.returned.removeprefix("Iterator[").removesuffix("]") if member.is_stream else member.returned
    return (
        f"\n\ndef {member.function}({', '.join(arguments)}) -> Call[{returned}]:\n"
        f'    return of("{name}", {request}, {read})\n'
    )
