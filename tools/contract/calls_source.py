"""Writes the modules of ``ual/_service_calls``: the call of each member of a service, for both clients."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence

from tools.contract import requests
from tools.contract.parts import CLIENT, INTERFACE, ContractPart, PartMember
from tools.contract.python_source import functions, imports, names_in, parsed
from tools.contract.values import Values
from tools.contract.words import snake

BY_HAND = CLIENT / "_service_calls" / "by_hand.py"
"""The calls that are more than a request and its response: ``fence_upload`` is that of ``Fence.upload``."""
CALLS = CLIENT / "_calls.py"
"""Handwritten calls of ``Uav``, by the names of its members."""


def source(values: Values, parts: Sequence[ContractPart]) -> str:
    """Returns the module of the parts of a file."""
    by_hand = functions(parsed(BY_HAND)) | functions(parsed(CALLS))
    named, calls = {}, ""
    for part in parts:
        for each in part.members:
            function = f"{part.module}_{each.name}"
            if function in by_hand:
                named[each.name] = function
            elif not each.is_streamed and not (part.name == "Uav" and each.name in by_hand):
                calls += _call(values, part, each)
    body = "\n" + "".join(f"{name} = {function}\n" for name, function in named.items()) + calls
    return f"{_head(values, parts, body, sorted(named.values()))}{body}"


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


def _head(values: Values, parts: Sequence[ContractPart], body: str, special: list[str]) -> str:
    used = names_in(body)
    calls = sorted({"Call", "built", "nothing", "of", "request"} & used)
    geometry = sorted({"Vector3", "checked_transform", "stamped_point"} & used)
    classes = " and ".join(f"`ual.interface.{each.name}`" for each in reversed(parts))
    return (
        f'"""The calls of {classes}. ``make proto`` writes this file: do not edit it."""\n\n'
        "from __future__ import annotations\n\n"
        f"from ual._calls import {', '.join(calls)}\n"
        + (f"from ual._service_calls.by_hand import {', '.join(special)}\n" if special else "")
        + "from ual._wrong_type import require\n" * ("require" in used)
        + (f"from ual.geometry import {', '.join(geometry)}\n" if geometry else "")
        + "from ual.shared.flags import flag\n" * ("flag" in used)
        + imports(INTERFACE, used - set(geometry))
        + f"from ual.v1 import {values.file}_pb2 as pb\n" * ("pb" in used)
        + f"from ual.wire import {values.wire} as wire\n" * ("wire" in used)
        + "from ual.wire import convert\n" * ("convert" in used)
        + "from ual.wire import samples\n" * ("samples" in used)
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
        request = requests.made(member, list(requests.written(values, part, member)))
    read = requests.result(values, member).read
    returned = member.returned.removeprefix("Iterator[").removesuffix("]") if member.is_stream else member.returned
    return (
        f"\n\ndef {member.function}({', '.join(arguments)}) -> Call[{returned}]:\n"
        + "".join(f"    {each}\n" for each in requests.checks(member))
        + f'    return of("{name}", {request}, {read})\n'
    )
