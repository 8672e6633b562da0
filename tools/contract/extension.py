"""Writes what follows from the contract of an extension: ``python -m tools.contract.extension examples/arm_extension``.

Stubs, values, codec, clients and the plain methods of the servicer, as for UAL's own services. By hand are the
``.proto``, the interface (the class ``X`` in ``interface.py`` of ``XService``), and the extension (``extension.py``).
"""

from __future__ import annotations

import ast
import sys
from dataclasses import dataclass
from pathlib import Path

from google.protobuf.descriptor_pb2 import FileDescriptorSet

from tools.contract import requests, values_source, wire_source
from tools.contract.compiled import ROOT, compiled
from tools.contract.description import services
from tools.contract.formatting import formatted
from tools.contract.parts import ContractPart, PartMember, whole
from tools.contract.python_source import classes, names_in
from tools.contract.stubs import stubs
from tools.contract.values import Values, values_of
from ual.contract.method import QUICK_S

EXAMPLES = (ROOT / "examples" / "arm_extension",)
"""The extensions of this repository."""
_MADE = "Written by ``tools.contract.extension``: do not edit it."
_BY_MAKE = "``make proto`` writes this file: do not edit it."


@dataclass(frozen=True)
class _Extension:
    """The package of an extension, such as ``ual_arm``, with its service."""

    package: str
    room: Path
    contract: FileDescriptorSet
    values: Values
    part: ContractPart

    @property
    def stub(self) -> str:
        return f"{self.part.service}Stub"

    @property
    def grpc(self) -> str:
        return f"{self.values.file}_pb2_grpc"


def derived(root: Path) -> dict[Path, str]:
    """Returns all that follows from the contract of an extension, by path."""
    found = _read(root)
    room = found.room
    sources = {
        room / "values.py": values_source.source(found.values),
        room / "wire.py": wire_source.source(found.values),
        room / "client.py": _clients(found),
        room / "servicer.py": _servicer(found),
    }
    file = f"{found.package}/v1/{found.values.file}.proto"
    made = {path: formatted(text.replace(_BY_MAKE, _MADE), found.package) for path, text in sources.items()}
    return {**stubs(found.contract, [file], root), **made}


def _read(root: Path) -> _Extension:
    [path] = root.glob("*/v1/*.proto")
    name = path.relative_to(root).as_posix()
    contract = compiled([name], root)
    file = next(each for each in contract.file if each.name == name)
    package, room = path.parents[1].name, path.parents[1]
    [service] = file.service
    part = whole(contract, service.name.removesuffix("Service"), service.name, room / "interface.py")
    values = values_of(contract, file, f"{package}.values", f"{package}.v1")
    return _Extension(package, room, contract, values, part)


def _clients(found: _Extension) -> str:
    name = found.part.name
    sync = "".join(_member(found, each, is_aio=False) for each in found.part.members)
    aio = "".join(_member(found, each, is_aio=True) for each in found.part.members)
    body = f'''

class {name}Client({name}):
    """`{name}`, over gRPC."""

    def __init__(self, link: Link) -> None:
        self._link = link
{sync}

class Aio{name}Client:
    """The same for asyncio: the members of `{name}` as coroutines."""

    def __init__(self, link: AioLink) -> None:
        self._link = link
{aio}'''
    used = names_in(body)
    values = sorted(used & {each.name for each in found.values.messages.values()})
    return (
        f'"""The clients of `{found.part.service}`, blocking and for asyncio. {_MADE}"""\n\n'
        "from __future__ import annotations\n\n"
        + "from collections.abc import AsyncIterator, Iterator\n\n"
        * ("Iterator" in used)
        + "from typing_extensions import override\n\n"
        "from ual.aio.extension import Link as AioLink\nfrom ual.extension import Link\n"
        + f"from {found.package} import wire\n" * ("wire" in used)
        + f"from {found.package}.interface import {name}\n"
        + (f"from {found.package}.values import {', '.join(values)}\n" if values else "")
        + f"from {found.package}.v1 import {found.values.file}_pb2 as pb\n"
        f"from {found.package}.v1.{found.grpc} import {found.stub}\n{body}"
    )


def _member(found: _Extension, member: PartMember, *, is_aio: bool) -> str:
    assert member.method is not None
    assert member.request is not None
    fields = ", ".join(requests.written(found.values, found.part, member))
    limit_s = _limit_s(found, member.method.name)
    limit = f", {limit_s}" * (limit_s not in (None, QUICK_S) and not member.is_stream)
    way = "stream" if member.is_stream else "call"
    call = f'self._link.{way}({found.stub}, "{member.method.name}", pb.{member.request.name}({fields}){limit})'
    read = requests.result(found.values, member).read
    result = read.removeprefix("lambda response: ") if read.startswith("lambda") else f"{read}(response)"
    waits = "await " if is_aio else ""
    if member.is_stream:
        body = f"        {'async ' * is_aio}for response in {call}:\n            yield {result}\n"
    elif read == "nothing":
        body = f"        {waits}{call}\n"
    else:
        body = f"        response = {waits}{call}\n        return {result}\n"
    returned = f"Async{member.returned}" if is_aio and member.is_stream else member.returned
    about = f'        """See `{found.part.name}.{member.name}`."""\n' * is_aio
    head = f"{'async ' * is_aio}def {member.name}({ast.unparse(member.signature)}) -> {returned}:"
    overrides = "" if is_aio else "    @override\n"
    return f"\n{overrides}    {head}\n{about}{body}"


def _limit_s(found: _Extension, method: str) -> float | None:
    [facts] = [each for service in services(found.contract) for each in service.methods if each.name == method]
    return facts.caller_limit_s


def _servicer(found: _Extension) -> str:
    """The methods that only pass fields on, and the roles. Those of ``XServicer`` in ``extension.py`` are more."""
    name = found.part.name
    by_hand = classes(found.room / "extension.py").get(f"{name}Servicer")
    more = set() if by_hand is None else {getattr(each, "name", "") for each in by_hand.body}
    methods = "".join(
        _method(found, each) for each in found.part.members if each.method and each.method.name not in more
    )
    [service] = [each for each in services(found.contract) if each.name == found.part.service]
    roles = "".join(f'    "{each.name}": Role.{each.role.name},\n' for each in service.methods)
    body = f'''
ROLES: Mapping[str, Role] = {{
{roles}}}
"""The role that each method needs."""


class {name}ServicerBase({found.grpc}.{found.part.service}Servicer):
    """Methods of `{found.part.service}` that are unpack, call and pack."""

    def __init__(self, served: {name}) -> None:
        self._served = served
{methods}'''
    used = names_in(body)
    return (
        f'"""`{found.part.service}`: roles, and unpack, call, pack. {_MADE}"""\n\n'
        "from __future__ import annotations\n\n"
        "from collections.abc import Mapping\n\n"
        + "from typing_extensions import override\n\n" * ("override" in used)
        + "from ual.access.roles import Role\n"
        + f"from {found.package} import wire\n" * ("wire" in used)
        + f"from {found.package}.interface import {name}\n"
        + f"from {found.package}.v1 import {found.values.file}_pb2 as pb\n" * ("pb" in used)
        + f"from {found.package}.v1 import {found.grpc}\n{body}"
    )


def _method(found: _Extension, member: PartMember) -> str:
    assert member.method is not None
    assert member.request is not None
    assert member.response is not None
    arguments = ", ".join(requests.read(found.values, found.part, member))
    pack = requests.result(found.values, member).pack
    head = f"async def {member.method.name}(self, request: pb.{member.request.name}, context: object)"
    call = f"{'result = ' * ('result' in pack)}self._served.{member.name}({arguments})"
    return f"\n    @override\n    {head} -> pb.{member.response.name}:\n        {call}\n        return {pack}\n"


def main() -> None:
    """Writes them into the directories that are named."""
    for root in map(Path, sys.argv[1:]):
        for path, text in derived(root.resolve()).items():
            path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
