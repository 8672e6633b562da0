"""Writes the members of the clients that are one call each: ``python tools/clients.py`` (`make clients`).

A member's signature and documentation are those of `ual.interface`, and its kind is that of its method in the contract.
Its request and its response are those of `ual._service_calls`, or of `ual._calls`, which is by hand. The sources are
written out, as the stubs of the contract are, because Python cannot type what is derived: no type variable stands for
"a coroutine of each member's result". Type checkers and editors see ordinary methods.
"""

from __future__ import annotations

import ast
import inspect
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tools.contract.calls_source import CALLS
from tools.contract.compiled import compiled
from tools.contract.parts import ContractPart, simulation, uav
from tools.contract.python_source import functions, parsed
from ual.contract.method import Kind
from ual.contract.methods import METHODS
from ual.shared import views

ROOT = Path(__file__).resolve().parents[1]
CLIENT = ROOT / "clients" / "python" / "ual"
INTERFACE = CLIENT / "interface.py"


class _CallForms(NamedTuple):
    """Calls of one kind: how a client sends them, and how a team passes them to its UAVs."""

    send: str
    give: str = ""


_WAYS = {
    Kind.QUESTION: _CallForms("_connection.run", "ask"),
    Kind.CHANGE: _CallForms("_connection.run", "each"),
    Kind.COMMAND: _CallForms("_command", "each"),
    Kind.STOP: _CallForms("_command", "ask"),
    Kind.SETPOINT: _CallForms("_setpoints.send", "ask"),
    Kind.EXTERNAL_POSE: _CallForms("_external_poses.send"),
    Kind.SIMULATION: _CallForms("_connection.run"),
}
_OF_UAV_BY_HAND = {"wait_for": "ask"}
"""Members that each client has of its own, and how a team gives them to its UAVs."""


def _kinds(part: ContractPart) -> dict[str, Kind]:
    return {each.name: METHODS[each.method.name].kind for each in part.members if each.method}


OF_UAV = _kinds(uav(compiled()))
"""The members of a UAV that are one call each."""
OF_SIMULATION = _kinds(simulation(compiled()))
MEMBERS = OF_UAV | OF_SIMULATION
_BY_HAND = functions(parsed(CALLS))


class _Member(NamedTuple):
    """A member of the interface: its signature and its documentation."""

    name: str
    arguments: ast.arguments
    returned: str
    documentation: str

    @property
    def signature(self) -> str:
        return f"{self.name}({ast.unparse(self.arguments)})"

    def passed(self, *without: str) -> str:
        """The arguments of a call that passes all of them on, by name where they could be mixed up."""
        ordered = [argument.arg for argument in self.arguments.args[1:] if argument.arg not in without]
        named = [argument.arg for argument in self.arguments.kwonlyargs if argument.arg not in without]
        if len(ordered) > 1:
            ordered, named = [], [*ordered, *named]
        rest = [f"*{self.arguments.vararg.arg}"] if self.arguments.vararg else []
        return ", ".join([*ordered, *rest, *(f"{name}={name}" for name in named)])

    def returning(self, call: str) -> str:
        return call if self.returned == "None" else f"return {call}"


def main() -> None:
    """Writes the modules."""
    for path, source in sources().items():
        path.write_text(source, encoding="utf-8")


def sources() -> dict[Path, str]:
    """Returns the modules as they should be, by path."""
    tree = ast.parse(INTERFACE.read_text(encoding="utf-8"))
    of_uav, world = _members(tree, "Uav"), _members(tree, "Simulation")
    calls = [each for each in of_uav if each.name in OF_UAV]
    of_aio = [each for each in of_uav if each.name in OF_UAV or _is_view(each)]
    of_simulation = [each for each in world if each.name in OF_SIMULATION]
    of_team = [each for each in of_uav if _passing_method(each)]
    modules = {
        "_derived.py": (_SYNC, [_SYNC_UAV, *map(_sync_call, calls), _SYNC_SIMULATION, *map(_sync_call, of_simulation)]),
        "_derived_team.py": (_SYNC_TEAM_HEAD, [_SYNC_TEAM, *map(_sync_team_member, of_team)]),
        "aio/_derived.py": (_AIO, [_AIO_UAV, *map(_aio_call, of_aio), _AIO_SIMULATION, *map(_aio_call, of_simulation)]),
        "aio/_derived_team.py": (_AIO_TEAM_HEAD, [_AIO_TEAM, *map(_aio_team_member, of_team)]),
    }
    return {CLIENT / name: _module(tree, head, "".join(body)) for name, (head, body) in modules.items()}


def _members(tree: ast.Module, owner: str) -> list[_Member]:
    [found] = [node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == owner]
    return [
        _Member(
            node.name,
            node.args,
            "" if node.returns is None else ast.unparse(node.returns),
            ast.get_docstring(node) or "",
        )
        for node in found.body
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_")
    ]


def _is_view(member: _Member) -> bool:
    return inspect.isfunction(getattr(views, member.name, None))


def _passing_method(member: _Member) -> str:
    """Returns the method by which a team passes a member to its UAVs; empty where a team has no such member."""
    if member.name in MEMBERS:
        return _WAYS[MEMBERS[member.name]].give
    return "ask" if _is_view(member) else _OF_UAV_BY_HAND.get(member.name, "")


def _call(member: _Member) -> str:
    """The call of a client's member: ``self._command(_calls.arm(), timeout_s)``."""
    room = "_simulation_calls" if member.name in OF_SIMULATION else "_uav_calls"
    call = f"{'_calls' if member.name in _BY_HAND else room}.{member.name}({member.passed('timeout_s')})"
    limit = ", timeout_s" if "timeout_s" in {each.arg for each in member.arguments.kwonlyargs} else ""
    return f"self.{_WAYS[MEMBERS[member.name]].send}({call}{limit})"


def _sync_call(member: _Member) -> str:
    return f"""
    @override
    def {member.signature} -> {member.returned}:
        {member.returning(_call(member))}
"""


def _aio_call(member: _Member) -> str:
    called = f"views.{member.name}(await self.telemetry())" if _is_view(member) else f"await {_call(member)}"
    return f"""
    async def {member.signature} -> {member.returned}:
{_documented(_without_example(member.documentation))}
        {member.returning(called)}
"""


def _sync_team_member(member: _Member) -> str:
    return f"""
    def {member.signature} -> {_of_all(member)}:
{_documented(_summary(member))}
        {member.returning(f"self._wait(self._team.{member.name}({member.passed()}))")}
"""


def _aio_team_member(member: _Member) -> str:
    call = f"self.{_passing_method(member)}(lambda _, uav: uav.{member.name}({member.passed()}))"
    return f"""
    async def {member.signature} -> {_of_all(member)}:
{_documented(_summary(member))}
        {member.returning(f"await {call}")}
"""


def _of_all(member: _Member) -> str:
    return "None" if member.returned == "None" else f"dict[str, {member.returned}]"


def _without_example(documentation: str) -> str:
    """The documentation without its example, which blocks."""
    return documentation.partition("\nExample:")[0].rstrip()


def _summary(member: _Member) -> str:
    first, _, _ = member.documentation.partition("\n\n")
    return f"{first}\n\nSee `ual.interface.Uav.{member.name}`."


def _documented(text: str) -> str:
    lines = f'"""{text}'.splitlines()
    lines[-1] += '"""' if len(lines) == 1 else '\n\n"""'
    return "\n".join(f"        {line}" if line else "" for line in "\n".join(lines).splitlines())


def _module(interface: ast.Module, head: str, classes: str) -> str:
    imports = "".join(_imports(interface, used=_names(classes) - _names(head)))
    return _formatted(head.replace(_IMPORTS, imports) + classes)


def _names(source: str) -> set[str]:
    """Returns the names that a module uses or imports."""
    nodes = list(ast.walk(ast.parse(source)))
    imported = {alias.name for node in nodes if isinstance(node, ast.ImportFrom) for alias in node.names}
    return imported | {node.id for node in nodes if isinstance(node, ast.Name)}


def _imports(interface: ast.Module, used: set[str]) -> Iterator[str]:
    """Yields the imports of names that the interface has from elsewhere."""
    for node in interface.body:
        if isinstance(node, ast.ImportFrom) and (names := used.intersection(alias.name for alias in node.names)):
            yield f"from {node.module} import {', '.join(sorted(names))}\n"


def _formatted(source: str) -> str:
    for command in (["check", "--quiet", "--fix", "--select", "I"], ["format", "--quiet"]):
        ruff = [sys.executable, "-m", "ruff", *command, "--stdin-filename", str(CLIENT / "_derived.py"), "-"]
        source = subprocess.run(ruff, input=source, capture_output=True, text=True, check=True, cwd=ROOT).stdout  # noqa: S603 (our own command)
    return source


_IMPORTS = "# imports\n"
_SYNC = '''"""The members that are one call each. ``make clients`` writes this file: do not edit it."""

from __future__ import annotations

from abc import abstractmethod
from typing import TypeVar

from typing_extensions import override

from ual import _calls, interface
from ual._calls import Call
from ual._connection import Connection
from ual._service_calls import simulation as _simulation_calls
from ual._service_calls import uav as _uav_calls
from ual._setpoints import Setpoints
# imports

T = TypeVar("T")
'''
_SYNC_UAV = '''
class UavMembers(interface.Uav):
    """Members of `ual.Uav`."""

    _connection: Connection
    _setpoints: Setpoints
    _external_poses: Setpoints

    @abstractmethod
    def _command(self, call: Call[T], timeout_s: float | None = None) -> T:
        """Makes a call that comes after the setpoints given before it."""
'''
_SYNC_SIMULATION = '''
class SimulationMembers(interface.Simulation):
    """Members of `ual.Uav.simulation`."""

    _connection: Connection
'''
_SYNC_TEAM_HEAD = '''"""A team's members that are one call each. ``make clients`` writes this file: do not edit it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Coroutine
from typing import Any, TypeVar

from ual import aio
# imports

T = TypeVar("T")
'''
_SYNC_TEAM = '''
class TeamMembers(ABC):
    """Members of `ual.Team`."""

    _team: aio.Team

    @abstractmethod
    def _wait(self, coroutine: Coroutine[Any, Any, T]) -> T:
        """Runs a coroutine of the asynchronous team to its end."""
'''
_AIO = '''"""The members that are one call each, for asyncio. ``make clients`` writes this file: do not edit it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TypeVar

from ual import _calls
from ual._calls import Call
from ual._service_calls import simulation as _simulation_calls
from ual._service_calls import uav as _uav_calls
from ual.aio._connection import Connection
from ual.aio._setpoints import Setpoints
from ual.shared import views
# imports

T = TypeVar("T")
'''
_AIO_UAV = '''
class UavMembers(ABC):
    """Members of `ual.aio.Uav`."""

    _connection: Connection
    _setpoints: Setpoints
    _external_poses: Setpoints

    @abstractmethod
    async def _command(self, call: Call[T], timeout_s: float | None = None) -> T:
        """Makes a call that comes after the setpoints given before it."""
'''
_AIO_SIMULATION = '''
class SimulationMembers:
    """Members of `ual.aio.Uav.simulation`."""

    _connection: Connection
'''
_AIO_TEAM_HEAD = '''"""A team's members that are one call each, for asyncio. ``make clients`` writes it: do not edit."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

from ual.aio._client import Uav
# imports

T = TypeVar("T")
'''
_AIO_TEAM = '''
class TeamMembers(ABC):
    """Members of `ual.aio.Team`."""

    @abstractmethod
    async def ask(self, call: Callable[[str, Uav], Coroutine[Any, Any, T]]) -> dict[str, T]:
        """Calls something for each UAV at the same time. Returns the results by name."""

    @abstractmethod
    async def each(self, command: Callable[[str, Uav], Coroutine[Any, Any, T]]) -> dict[str, T]:
        """Gives each UAV a command, all at the same moment. Returns the results by name."""
'''


if __name__ == "__main__":
    main()
