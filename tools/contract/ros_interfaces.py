"""Writes ``clients/ros2/ual_msgs``: the messages, services and actions of ROS."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from tools.contract import ros_comments, ros_names
from tools.contract.compiled import ROOT
from tools.contract.ros_rules import RosField
from tools.contract.ros_shapes import Served, Shapes, Struct

PACKAGE = ROOT / "clients" / "ros2" / "ual_msgs"
OUTCOME = (
    RosField("bool", "success"),
    RosField(
        "string",
        "reason",
        comment="the name of the error in docs/reference/errors.md, as WRONG_STATE; empty on success",
    ),
    RosField("string", "message", comment="what was refused, why, and what to do, human-readable"),
    RosField("diagnostic_msgs/KeyValue[]", "metadata", comment="of the error, as `state`, `needed` and `by`"),
)


def interfaces(shapes: Shapes) -> dict[Path, str]:
    """Returns the files, by path."""
    by_type: dict[str, list[Served]] = {}
    for each in shapes.served():
        by_type.setdefault(each.type, []).append(each)
    by_type.pop("Trigger")
    actions = [each for each in shapes.served(also_actions=True) if each.goal_items]
    made = {
        **{PACKAGE / "msg" / f"{each.name}.msg": _message(each) for each in shapes.structs()},
        **{PACKAGE / "srv" / f"{name}.srv": _service(served) for name, served in by_type.items()},
        **{PACKAGE / "action" / f"{each.type}.action": _action(each) for each in actions},
    }
    cmake = PACKAGE / "CMakeLists.txt"
    return {**made, cmake: _listed(cmake.read_text(encoding="utf-8"), made)}


def _listed(cmake: str, made: Mapping[Path, str]) -> str:
    """Returns the file of CMake with all interfaces: messages after those that they have (unite.cmake)."""
    texts = {path.stem: text for path, text in made.items() if path.suffix == ".msg"}
    texts |= {
        Path(name).stem: (PACKAGE / "msg" / name).read_text() for name in ros_names.BY_HAND if name.endswith(".msg")
    }

    def depth(name: str) -> int:
        used = {found for found in re.findall(r"^(\w+)(?:\[.*?\])? \w+", texts[name], re.MULTILINE) if found in texts}
        return max((1 + depth(each) for each in used), default=0)

    paths = [path.relative_to(PACKAGE).as_posix() for path in made]
    paths += [f"{Path(name).suffix[1:]}/{name}" for name in ros_names.BY_HAND]
    order = ("msg", "srv", "action")
    kinds = {path: path.partition("/")[0] for path in paths}
    paths.sort(key=lambda path: (order.index(kinds[path]), depth(Path(path).stem) if kinds[path] == "msg" else 0, path))
    begin, end = "rosidl_generate_interfaces(${PROJECT_NAME}\n", "  DEPENDENCIES"
    before, _, rest = cmake.partition(begin)
    return before + begin + "".join(f"  {path}\n" for path in paths) + end + rest.partition(end)[2]


def _message(struct: Struct) -> str:
    head = ros_comments.head(struct.head)
    constants = [*struct.constants, ""] if struct.constants else []
    return _text([*head, ros_comments.BY_TOOL, *constants, *_declared(struct.items)])


def _service(served: list[Served]) -> str:
    first = served[0]
    heads = [first.head] if len(served) == 1 else [f"`{each.name}`: {each.head}" for each in served]
    lines = [line for head in heads for line in ros_comments.head(head)]
    constants = (
        [*first.constants, ""]
        if first.constants and any(i.name == "altitude_reference" for i in first.request_items)
        else []
    )
    answer = [_on_success(each) for each in first.response_items]
    return _text(
        [
            *lines,
            ros_comments.BY_TOOL,
            *constants,
            *_declared(first.request_items),
            "---",
            *_declared(OUTCOME),
            *_declared(answer),
        ]
    )


def _action(served: Served) -> str:
    goal = [each for each in served.goal_items if each.name not in ros_names.NOT_OF_ACTION]
    result = [ros_names.WAS_TASK, *([ros_names.PLAN] if served.has_plan else [])]
    told = (
        *ros_names.FEEDBACK,
        *ros_names.FEEDBACK_OF.get(served.method, ()),
        ros_names.ITS_TASK,
        *ros_names.FEEDBACK_AFTER.get(served.method, ()),
    )
    constants = [*served.constants, ""] if served.constants else []
    lines = [*ros_comments.head(served.head), ros_comments.BY_TOOL, *constants, *_declared(goal)]
    return _text([*lines, "---", *_declared(OUTCOME), *_declared(result), "---", *_declared(told)])


def _on_success(item: RosField) -> RosField:
    if item.name == "task_id":
        return item
    return RosField(item.type, item.name, "", ros_comments.trailing(item.comment, "only on success"))


def _declared(items: Iterable[RosField]) -> list[str]:
    return [line for each in items for line in ros_comments.declared(f"{each.type} {each.name}", each.comment)]


def _text(lines: Iterable[str]) -> str:
    return "".join(f"{line}\n" for line in lines)
