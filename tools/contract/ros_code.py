"""Writes ``ual_ros2/derived``: the code of the node that fills and reads messages, its calls and its services.

The tests' own program in ROS has the other direction, in ``ual_ros2/test/derived.py``.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from tools.contract.compiled import ROOT
from tools.contract.formatting import formatted
from tools.contract.parts import INTERFACE
from tools.contract.python_source import classes, functions
from tools.contract.ros_rules import RosField
from tools.contract.ros_shapes import Served, Shapes, Struct
from tools.contract.words import snake

PACKAGE = ROOT / "clients" / "ros2" / "ual_ros2"
TESTS = PACKAGE / "test"
_FIELDS = (
    "Fields", "angle_range", "geo_point_fields", "in_bytes", "key_values", "name_of", "named", "names_of", "none_of",
    "point_stamped", "quaternion", "ratio", "read_all", "read_geo_point", "stamp", "transform", "vector",
)  # fmt: skip
"""Names of ``ual_ros2.services.fields``."""
_READING = (
    "error_of", "finite", "fix", "in_mib", "intrinsics", "link_of", "number", "orientation", "parameter_value", "path",
    "percent", "point_of", "pose_stamped", "read_angle_range", "read_viewpoint", "transform_stamped",
    "twist_stamped",
)  # fmt: skip
"""Names of ``reading`` in the tests."""
_BY_HAND = ("GeoPoint",)
"""Messages whose code is in ``ual_ros2.services.fields``: a pair of numbers in Python."""


def code(shapes: Shapes) -> dict[Path, str]:
    """Returns the modules, by path."""
    structs = [each for each in shapes.structs() if each.name not in _BY_HAND]
    served = list(shapes.served(also_actions=True))
    derived = PACKAGE / "ual_ros2" / "derived"
    return {
        derived / "values.py": _values(structs),
        derived / "calls.py": _calls(served, structs),
        derived / "services.py": _services(served),
        derived / "names.py": _names(structs, served),
        TESTS / "derived_values.py": _client_values(structs, served),
        TESTS / "derived_members.py": _client_members(structs, served),
    }


# --- Values -----------------------------------------------------------------------------------------------------------


def _values(structs: Sequence[Struct]) -> str:
    body = [
        *(_fields_function(each) for each in structs if each.is_told),
        *(_read(each) for each in structs if each.is_asked),
    ]
    return _module("Messages of ``ual_msgs`` and values of UAL, by the rules of the contract.", "\n\n".join(body))


def _fields_function(struct: Struct) -> str:
    """Returns the function that makes the fields of a message."""
    head = (
        f"def {snake(struct.name)}_fields(value: {struct.kind}) -> Fields:\n"
        f'    """Returns the fields of a message `{struct.name}`."""\n'
    )
    if not struct.variants:
        return f"{head}    return {{{_entries(struct.part.items, 'value.')}}}\n"
    common = _entries(struct.part.items, "value.")
    cases = "".join(
        f"        case {each.kind}():\n"
        f'            return {{{common} "kind": "{each.name}", {_entries(each.part.items, "value.")}}}\n'
        for each in struct.variants
    )
    return f'{head}    match value:\n{cases}    raise TypeError(f"{{value!r}} is no {struct.name}")\n'


def _read(struct: Struct) -> str:
    """Returns the function that makes a value of a message."""
    head = (
        f"def read_{snake(struct.name)}(message: Message) -> {struct.kind}:\n"
        f'    """Reads a message `{struct.name}`."""\n'
    )
    if struct.is_part:
        head = head.replace(f"-> {struct.kind}", "-> dict[str, Any]").replace("Reads", "Reads attributes out of")
        entries = "".join(f'"{name}": {read.replace("{m}", "message")},' for name, read in struct.part.reads)
        return f"{head}    return {{{entries}}}\n"
    if not struct.variants:
        return f"{head}    return {struct.kind}({_arguments(struct.part.reads)})\n"
    cases = "".join(
        f'        case "{each.name}":\n'
        f"            return {each.kind}({_arguments((*each.part.reads, *struct.part.reads))})\n"
        for each in struct.variants
    )
    names = tuple(each.name for each in struct.variants)
    return f'{head}    match message.kind:\n{cases}    raise none_of("kind", message.kind, {names!r})\n'


def _entries(items: Iterable[RosField], owner: str) -> str:
    return "".join(f'"{each.name}": {_of(each.told, owner)},' for each in items if each.told)


def _of(told: str, owner: str) -> str:
    """Returns an expression of the attributes of an owner, or of arguments."""
    told = told.replace("{self}", owner.rstrip(".")).replace("{{}}", "\0")
    return re.sub(r"\{(\w+)\}", lambda found: f"{owner}{found[1]}", told).replace("\0", "{}")


def _arguments(reads: Iterable[tuple[str, str]], message: str = "message") -> str:
    found = ((name, read.replace("{m}", message)) for name, read in reads)
    return ", ".join(f"**{read}" if name == "**" else f"{name}={read}" for name, read in found)


# --- Calls ------------------------------------------------------------------------------------------------------------


def _calls(served: Sequence[Served], structs: Sequence[Struct]) -> str:
    own = [each for each in served if each.member and not each.is_by_hand]
    flown = [each for each in served if each.member and each.goal_items and each.is_of_service is False]
    calls = [each for each in own if each.has_service]
    functions = [*map(_call, calls), *map(_flight, flown)]
    table = "".join(f'    "{each.name}": {_function(each)},\n' for each in calls)
    flights = "".join(f'    "{each.name}": fly_{_function(each)},\n' for each in flown)
    body = "\n\n".join(functions)
    tables = (
        f"\n\nCALLS: Final[Mapping[str, Serves]] = {{\n{table}}}\n"
        '"""The calls that do no more than pass on what they are given, by the names of their services."""\n'
        f"FLIGHTS: Final[Mapping[str, Flies]] = {{\n{flights}}}\n"
        '"""The motions of actions, by their names."""\n'
    )
    return _module("The calls of the node that follow from the contract.", body + tables, structs)


def _function(served: Served) -> str:
    return served.name.replace("simulation/", "simulation_")


def _flight(served: Served) -> str:
    """Returns the function that flies a goal, or asks what it would be."""
    call = f"flyer.{served.member.removeprefix('uav.')}({_arguments(served.arguments, 'goal')})"
    goal = "goal" if "goal" in call else "_"
    return (
        f"def fly_{_function(served)}(flyer: Flyer, {goal}: Message) -> Awaitable[object]:\n"
        f'    """Flies {served.type}, or asks what it would be."""\n'
        f"    return {call}\n"
    )


def _task(served: Served) -> str:
    """Returns the function that serves a task with the fields that its service has."""
    there = {each.name for each in served.request_items}
    given = [(name, read) for name, read in served.arguments if set(re.findall(r"\{m\}\.(\w+)", read)) <= there]
    arguments = ", ".join(filter(None, (_arguments(given, "request"), "blocking=request.blocking")))
    return (
        f"async def {_function(served)}(uav: ual.aio.Uav, request: Message) -> Fields:\n"
        f'    """Serves {served.type}."""\n'
        f"    begun = await {served.member}({arguments})\n"
        '    return {"task_id": begun.id}\n'
    )


def _call(served: Served) -> str:
    if served.goal_items:
        return _task(served)
    call = f"await {served.member}({_arguments(served.arguments, 'request')})"
    request = "request" if "request" in call else "_"
    head = (
        f"async def {_function(served)}(uav: ual.aio.Uav, {request}: Message) -> Fields:\n"
        f'    """Serves {served.type}."""\n'
    )
    if not served.response_items:
        return f"{head}    {call}\n    return {{}}\n"
    attributes = {name for name, _ in served.response.reads}
    if len(attributes) == 1:
        [attribute] = attributes
        told = "".join(
            f'"{each.name}": {each.told.replace(f"{{{attribute}}}", "found")},' for each in served.response.items
        )
    else:
        told = _entries(served.response.items, "found.")
    return f"{head}    found = {call}\n    return {{{told}}}\n"


# --- Services ---------------------------------------------------------------------------------------------------------


def _services(served: Sequence[Served]) -> str:
    flying = "".join(_row(each) for each in served if not each.is_of_service and each.has_service)
    ours = "".join(_row(each) for each in served if each.is_of_service and not each.is_simulation)
    world = "".join(_row(each) for each in served if each.is_simulation)
    tasks = "".join(_task_row(each) for each in served if not each.is_of_service and each.goal_items)
    return formatted(
        f'''"""The services and actions of the node. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from typing import Final

from std_srvs.srv import Trigger
from ual_msgs import action, srv

from ual_ros2.command import Service

FLYING: Final = ({flying})
"""Services of flights, and questions about a flight."""
TASKS: Final = ({tasks})
"""The actions that fly. Their names are those of services: ROS keeps the two apart."""
SERVICES: Final = ({ours})
"""Services other than flying."""
SIMULATION: Final = ({world})
"""Additional services of a simulated UAV."""
'''
    )


def _row(served: Served) -> str:
    frames = f", {served.frames!r}" if served.frames else ""
    return f'Service("{served.name}", {_type(served)}, "{served.method}"{frames}),\n'


def _task_row(served: Served) -> str:
    frames = f", {served.goal_frames!r}" if served.goal_frames else ""
    return f'Service("{served.name}", action.{served.type}, "{served.method}"{frames}),\n'


# --- Names ------------------------------------------------------------------------------------------------------------


def _names(structs: Sequence[Struct], served: Sequence[Served]) -> str:
    """Returns the module with the fields of requests that Python calls otherwise."""
    reads = [read for each in served for read in each.request.reads]
    for struct in structs:
        if struct.is_asked:
            reads += [*struct.part.reads, *(read for each in struct.variants for read in each.part.reads)]
    names: dict[str, set[str]] = {}
    for attribute, read in reads:
        there = [each for each in re.findall(r"\{m\}\.([\w.]+)", read) if not each.startswith(("has_", "is_"))]
        if there and there[0] != attribute:
            names.setdefault(attribute, set()).add(there[0])
    rows = "".join(f'"{name}": {tuple(sorted(there))!r},\n' for name, there in sorted(names.items()))
    return _module(
        "Fields of requests that UAL calls otherwise than ROS.",
        f"NAMES: Final[Mapping[str, tuple[str, ...]]] = {{{rows}}}\n",
    )


# --- The program of the tests -----------------------------------------------------------------------------------------


def _client_values(structs: Sequence[Struct], served: Sequence[Served]) -> str:
    body = [
        *(_fields_function(each) for each in structs if not each.is_told),
        *(_read(each) for each in structs if not each.is_asked),
        *(_request_function(each) for each in served if each.member and each.is_whole and _has_request(each)),
    ]
    return _module("Requests and answers of the tests' program in ROS.", "\n\n".join(body), structs)


def _has_request(served: Served) -> bool:
    """Returns whether a member of the tests' program has its request: a derived one, or one by hand."""
    return served.is_of_service or any(_asks(served) in path.read_text("utf-8") for path in TESTS.glob("ros_*.py"))


def _client_members(structs: Sequence[Struct], served: Sequence[Served]) -> str:
    rows = "".join(
        f'("{_owner(each)}", "{each.member.rpartition(".")[2]}"): '
        f'Member({_type(each)}, "{each.name}", {_asks(each)}, {_answer(each)}),\n'
        for each in _members(served)
    )
    body = f"MEMBERS: Final[Mapping[tuple[str, str], Member]] = {{\n{rows}}}\n\n\n{_service_members()}"
    return _module(
        "The members of `ual.interface` that are services in ROS.",
        body,
        structs,
        [_asks(each) for each in _members(served)],
    )


def _service_members() -> str:
    """Returns the class with the members of a UAV that are services beside flying."""
    uav = functions(classes(INTERFACE)["Uav"])
    found = [(name, ast.unparse(each.returns)) for name, each in uav.items() if each.returns and _is_part(each)]
    members = "".join(
        f"    @property\n    def {name}(self) -> ual.interface.{kind}:\n"
        f"        found: ual.interface.{kind} = self._services.{name}\n        return found\n\n"
        for name, kind in found
    )
    return (
        "class ServiceMembers(ual.interface.Uav):\n"
        '    """A UAV with its services beside flying."""\n\n'
        f"    _services: Any\n\n{members}"
    )


def _is_part(member: ast.FunctionDef) -> bool:
    """Returns whether a member of `ual.interface.Uav` is a service beside flying."""
    kind = "" if member.returns is None else ast.unparse(member.returns)
    is_property = any(ast.unparse(each) == "property" for each in member.decorator_list)
    return is_property and kind in classes(INTERFACE) and kind != "Simulation"


def _members(served: Sequence[Served]) -> list[Served]:
    return [each for each in served if each.member and each.is_whole and each.is_of_service]


def _type(served: Served) -> str:
    return "Trigger" if served.type == "Trigger" else f"srv.{served.type}"


def _owner(served: Served) -> str:
    owner = served.member.removeprefix("uav.").rpartition(".")[0]
    return re.sub(r"s\[.*", "", owner)


def _asks(served: Served) -> str:
    return f"ask_{_function(served)}"


def _request_function(served: Served) -> str:
    names = [name for name, _ in served.arguments]
    signature = f"*, {', '.join(f'{each}: Any' for each in names)}" if names else ""
    items = [each for each in served.request.items if re.search(r"\{\w+\}", each.told)]
    told = [each for each in items if set(re.findall(r"\{(\w+)\}", each.told)) <= set(names)]
    return (
        f"def {_asks(served)}({signature}) -> Fields:\n"
        f'    """Returns the request of {served.name}."""\n'
        f"    return {{{_entries(told, '')}}}\n"
    )


def _answer(served: Served) -> str:
    reads = served.response.reads
    if not reads:
        return "nothing"
    if len(reads) == 1:
        return f"lambda answer: {reads[0][1].replace('{m}', 'answer')}"
    return f"lambda answer: {served.answer_kind}({_arguments(reads, 'answer')})"


# --- Modules ----------------------------------------------------------------------------------------------------------


def _module(title: str, body: str, structs: Sequence[Struct] = (), asks: Sequence[str] = ()) -> str:
    """Returns a module with the imports that its body needs."""
    modules = sorted({found.rpartition(".")[0] for found in re.findall(r"\bual(?:\.[a-z]+)+\.[A-Z]\w+", body)})
    own = set(re.findall(r"^(?:async )?def (\w+)", body, re.MULTILINE))
    used = set(re.findall(r"(?<![.\w\"])(\w+)\(", body)) | set(re.findall(r"(?:map|read_all)\((\w+)", body))
    used |= {
        each
        for each in (
            "Any",
            "Awaitable",
            "Fields",
            "Final",
            "Flies",
            "Flyer",
            "Mapping",
            "Message",
            "Member",
            "Serves",
            "nothing",
        )
        if each in body
    }
    used |= {each for each in ("math", "paths", "pictures", "values") if re.search(rf"(?<![.\w]){each}\.", body)}
    used -= own
    told = {f"{snake(each.name)}_fields" for each in structs if each.is_told} | {
        f"read_{snake(each.name)}" for each in structs if each.is_asked
    }
    others = {f"read_{snake(each.name)}" for each in structs} | {f"{snake(each.name)}_fields" for each in structs}
    others = (others - told | {each for each in asks if each in body}) - own
    lines = [
        f'"""{title}\n\n``make proto`` writes this file: do not edit it.\n"""\n',
        "from __future__ import annotations\n",
        *(["import math"] if "math" in used else []),
        *_imported("collections.abc", sorted({"Awaitable", "Mapping"} & used)),
        *([f"from typing import {', '.join(sorted({'Any', 'Final'} & used))}"] if {"Any", "Final"} & used else []),
        *(["import ual"] if "ual." in body else []),
        *(f"import {each}" for each in modules if each != "ual"),
        *(["from std_srvs.srv import Trigger", "from ual_msgs import srv"] if "srv." in body else []),
        *_imported("ual_ros2", sorted({"paths", "pictures", "values"} & used)),
        *_imported("ual_ros2.services.fields", sorted(set(_FIELDS) & used)),
        *_imported("reading", sorted((set(_READING) | {"Member", "nothing"}) & used)),
        *_imported("ual_ros2.command", sorted({"Flies", "Flyer", "Serves"} & used)),
        *_imported("ual_ros2.derived.values", sorted(told & used - own)),
        *_imported("derived_values", sorted(others & (used | set(asks)))),
        *_imported("ual_ros2.messages", sorted({"Message"} & used)),
    ]
    return formatted("\n".join(lines) + "\n\n\n" + body)


def _imported(module: str, names: Sequence[str]) -> Iterator[str]:
    if names:
        yield f"from {module} import {', '.join(names)}"
