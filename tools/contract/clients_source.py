"""Writes ``_derived_parts.py`` of both clients: the services beside that of the UAV, over gRPC."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from pathlib import Path

from tools.contract.parts import CLIENT, INTERFACE, ContractPart, PartMember
from tools.contract.python_source import classes, imports, names_in

SYNC = CLIENT / "_derived_parts.py"
AIO = CLIENT / "aio" / "_derived_parts.py"
_SYNC_HEAD = '''"""The services beside that of the UAV. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Iterator

from typing_extensions import override

from ual import interface
from ual._connection import Connection
'''
_AIO_HEAD = '''"""The services beside that of the UAV, for asyncio. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import AsyncIterator

from ual.aio._connection import Connection
'''


def sync_source(parts: Sequence[ContractPart]) -> str:
    """Returns the module of the client."""
    body = "".join(_part(each, SYNC, f"interface.{each.name}") for each in parts)
    owners = "".join(_property(each, "    @override\n", "") for each in parts if not each.bound)
    return _module(
        _SYNC_HEAD, parts, SYNC, body + _owner(parts, "class PartMembers(interface.Uav):", "ual.Uav") + owners
    )


def aio_source(parts: Sequence[ContractPart]) -> str:
    """Returns the module of its twin for asyncio."""
    body = "".join(_part(each, AIO, "") for each in parts)
    about = {each.name: each for each in classes(INTERFACE)["Uav"].body if isinstance(each, ast.FunctionDef)}
    owners = "".join(
        _property(each, "", _documented(ast.get_docstring(about[each.module]) or ""))
        for each in parts
        if not each.bound
    )
    return _module(_AIO_HEAD, parts, AIO, body + _owner(parts, "class PartMembers:", "ual.aio.Uav") + owners)


def _module(head: str, parts: Sequence[ContractPart], path: Path, body: str) -> str:
    used = names_in(body)
    calls = "".join(
        f"from ual._service_calls import {file} as _{file}_calls\n"
        for file in sorted({each.file for each in parts if _calls(each) in used})
    )
    bases = "".join(
        f"from ual.{'aio.' * (path == AIO)}_{each.module} import {each.name}Base\n"
        for each in parts
        if f"{each.name}Base" in used
    )
    return head + calls + bases + imports(INTERFACE, used - {"AsyncIterator", "Iterator", "Any"}) + body


def _calls(part: ContractPart) -> str:
    return f"_{part.file}_calls"


def _owner(parts: Sequence[ContractPart], declaration: str, of: str) -> str:
    made = "".join(f"        self.{each.module} = {each.name}(connection)\n" for each in parts if not each.bound)
    return f'''

class Parts:
    """The services of a UAV."""

    def __init__(self, connection: Connection) -> None:
{made}

{declaration}
    """The members of `{of}` that return its services."""

    _parts: Parts
'''


def _property(part: ContractPart, decorator: str, about: str) -> str:
    head = f"    @property\n{decorator}    def {part.module}(self) -> {part.name}:\n{about}"
    return f"\n{head}        return self._parts.{part.module}\n"


def _part(part: ContractPart, path: Path, interface: str) -> str:
    """A class, with a base by hand where there is one: ``XBase`` in the module ``_x``."""
    by_hand = classes(path.parent / f"_{part.module}.py").get(f"{part.name}Base")
    own = set() if by_hand is None else {getattr(each, "name", "") for each in by_hand.body}
    bases = ", ".join(filter(None, (f"{part.name}Base" * bool(own), interface)))
    make = _sync_member if path == SYNC else _aio_member
    members = "".join(make(part, each) for each in part.members if each.name not in own)
    numbered = (_SYNC_NUMBERED if path == SYNC else _AIO_NUMBERED).replace("EACH", part.of_each) if part.of_each else ""
    return _head(part, f"({bases})" if bases else "") + numbered + members


def _head(part: ContractPart, bases: str) -> str:
    parameter = ", number: int" if part.bound else ""
    kept = "\n        self._number = number" if part.bound else ""
    shown = f"{part.name} {{self._number}}" if part.bound else part.name
    return f'''

class {part.name}{bases}:
    """`ual.interface.{part.name}`, over gRPC."""

    def __init__(self, connection: Connection{parameter}) -> None:
        self._connection = connection{kept}

    def __repr__(self) -> str:
        return f"<{shown} of {{self._connection.described}}>"
'''


_SYNC_NUMBERED = """
    @override
    def __getitem__(self, number: int) -> EACH:
        return EACH(self._connection, number)

    @override
    def __iter__(self) -> Iterator[EACH]:
        return (self[each.number] for each in self.get_all())
"""
_AIO_NUMBERED = '''
    def __getitem__(self, number: int) -> EACH:
        """Returns that of a number. Asks nothing: whether there is one shows when it is used."""
        return EACH(self._connection, number)

    async def __aiter__(self) -> AsyncIterator[EACH]:
        """Yields each that was found."""
        for each in await self.get_all():
            yield self[each.number]

    __iter__ = None  # Python would else count numbers without an end
'''


def _call(part: ContractPart, member: PartMember) -> str:
    way = "iterate" if member.is_stream else "run"
    passed = ", ".join(filter(None, ("self._number" * bool(part.bound), member.passed())))
    return f"self._connection.{way}({_calls(part)}.{member.function}({passed}))"


def _sync_member(part: ContractPart, member: PartMember) -> str:
    returned = "" if member.returned == "None" else "return "
    head = f"def {member.name}({ast.unparse(member.signature)}) -> {member.returned}:"
    return f"\n    @override\n    {head}\n        {returned}{_call(part, member)}\n"


def _aio_member(part: ContractPart, member: PartMember) -> str:
    before, returned = ("", f"Async{member.returned}") if member.is_stream else ("async ", member.returned)
    call = ("" if member.returned == "None" else "return ") + "await " * (not member.is_stream) + _call(part, member)
    head = f"{before}def {member.name}({ast.unparse(member.signature)}) -> {returned}:"
    documentation = member.documentation.partition("\nExample:")[0].rstrip()  # which blocks
    return f"\n    {head}\n{_documented(documentation)}        {call}\n"


def _documented(text: str) -> str:
    lines = f'"""{text}'.splitlines()
    lines = [*lines[:-1], f'{lines[-1]}"""'] if len(lines) == 1 else [*lines, "", '"""']
    return "".join(f"        {line}".rstrip() + "\n" for line in lines)
