"""Record of the names that programs in ROS rely on, in tests/data/ros2.txt: the fields of each interface, and the
server of each name.

``python -m tests.clients.ros2.record`` (``make wire``) adds what is not recorded yet, and changes nothing.
"""

from __future__ import annotations

import ast
import importlib
import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from unittest.mock import MagicMock, patch

ROOT = Path(__file__).parents[3]
RECORD = ROOT / "tests" / "data" / "ros2.txt"
INTERFACES = ROOT / "clients" / "ros2" / "ual_msgs"
PACKAGE = ROOT / "clients" / "ros2" / "ual_ros2"
REMEDY = (
    "Programs in ROS that are installed would not understand the node any more: ROS compares the types of all fields, "
    f"and their order. Undo it. What cannot stay is deleted from {RECORD.name}."
)
_OURS = frozenset({"ual", "ual_ros2"})


class _Base:
    """A class of ROS of which the node derives."""

    def __init__(self, *_: object, **__: object) -> None:
        """Takes what rclpy takes."""


class _Type(str):
    """The name of a type of ROS, which stands for the type."""

    __slots__ = ()


class _Service(_Type):
    Response = MagicMock()


class _Action(_Type):
    Result = MagicMock()


class _Types(ModuleType):
    """A module of interfaces."""

    def __getattr__(self, name: str) -> _Type:
        kind = _Action if self.__name__.endswith(".action") else _Service
        return kind(f"{self.__name__.replace('.', '/')}/{name}")


def _imported(file: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield str(node.module)


def modules_of_ros() -> set[str]:
    """Returns the modules of others that the node and its launch file import."""
    files = (*PACKAGE.glob("ual_ros2/**/*.py"), *PACKAGE.glob("launch/*.py"))
    found = {name for file in files for name in _imported(file)}
    return {name for name in found if name.partition(".")[0] not in _OURS | sys.stdlib_module_names}


@contextmanager
def without_ros(fakes: Mapping[str, object] = {}) -> Iterator[None]:
    """Puts fakes in the place of ROS; the modules of the node that are imported meanwhile go with them."""
    before = set(sys.modules)
    mocks = {name: MagicMock(name=name, ActionServer=_Base, CallbackGroup=_Base) for name in modules_of_ros()}
    with patch.dict(sys.modules, {**mocks, **fakes}), patch.object(sys, "path", [str(PACKAGE), *sys.path]):
        yield
        for name in [name for name in sys.modules.keys() - before if name.startswith("ual_ros2.")]:
            del sys.modules[name]


def recorded() -> set[str]:
    """Returns what programs rely on."""
    return set(RECORD.read_text(encoding="utf-8").splitlines()) if RECORD.exists() else set()


def found() -> set[str]:
    """Returns the same as it is now."""
    return {*map(_declared, INTERFACES.glob("*/*.*")), *_served()}


def _declared(path: Path) -> str:
    """Returns what a file declares, in one line."""
    lines = (re.sub(r"\s*#.*", "", line) for line in path.read_text(encoding="utf-8").splitlines())
    return f"{path.relative_to(INTERFACES).as_posix()}: {'; '.join(filter(None, lines))}"


def _served() -> Iterator[str]:
    srv, action = _Types("ual_msgs.srv"), _Types("ual_msgs.action")
    of_ual = {"ual_msgs": MagicMock(srv=srv, action=action), "ual_msgs.srv": srv, "ual_msgs.action": action}
    with without_ros({**of_ual, "std_srvs.srv": _Types("std_srvs.srv")}):
        flights = importlib.import_module("ual_ros2.flights")
        filling = importlib.import_module("ual_ros2.services.filling").Filling()
        table = importlib.import_module("ual_ros2.services.service_table").ServiceTable(filling, MagicMock(), None)
        for each in (*flights.SERVICES, *table.services(), *table.simulation()):
            yield f"service {each.name}: {each.kind} of {each.facts.name}"
        for each in (*flights.ACTIONS, *table.actions()):
            yield f"action {each.name}: {each.kind} of {each.facts.name}"


def main() -> None:
    """Adds what is new."""
    RECORD.write_text("".join(f"{line}\n" for line in sorted(recorded() | found())), encoding="utf-8")


if __name__ == "__main__":
    main()
