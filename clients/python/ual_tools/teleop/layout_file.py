"""Reads a layout from a YAML file. docs/how-to/fly-by-joystick.md describes it."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import TypeVar

from ual.joystick import Axis, Button
from ual_tools.strict_yaml.nodes import Node, read
from ual_tools.teleop.actions import Action
from ual_tools.teleop.layout import DEAD_ZONE_DEFLECTION, EXPO_SHARE, TWO_BUTTONS, Layout, StickAxis

E = TypeVar("E", bound=Enum)
_NONE = "none"
_ACTIONS = {action.name.lower(): action for action in Action}


def load(path: Path) -> Layout:
    """Returns the layout of a file. What it leaves out is as in the default one.

    Raises:
        YamlFileError: It cannot be read, or is not valid; the message has the line.

    """
    entries = read(path).entries(("hold", "dead_zone", "expo", "sticks", "actions"))
    dead_zone = _share(entries["dead_zone"]) if "dead_zone" in entries else DEAD_ZONE_DEFLECTION
    expo = _share(entries["expo"]) if "expo" in entries else EXPO_SHARE
    layout = Layout()
    sticks = {name: replace(axis, dead_zone=dead_zone, expo=expo) for name, axis in layout.sticks.items()}
    if "sticks" in entries:
        for name, node in entries["sticks"].entries(sticks).items():
            sticks[name] = _stick(node, dead_zone, expo)
    actions = dict(layout.actions)
    if "actions" in entries:
        for name, node in entries["actions"].entries(_ACTIONS).items():
            actions[_ACTIONS[name]] = _buttons(node, _ACTIONS[name])
    hold = _hold(entries["hold"]) if "hold" in entries else layout.hold
    return Layout(hold, sticks, {action: buttons for action, buttons in actions.items() if buttons})


def _share(node: Node) -> float:
    value = node.number()
    if value >= 1.0:
        raise node.error("expected a number from 0 to below 1")
    return value


def _stick(node: Node, dead_zone: float, expo: float) -> StickAxis:
    """Reads ``righty``, ``-righty`` (inverted), or a mapping with `axis`, `dead_zone` and `expo`."""
    entries = {"axis": node} if node.is_text else node.entries(("axis", "dead_zone", "expo"))
    if "axis" not in entries:
        raise node.error("axis is missing")
    text = entries["axis"].text()
    return StickAxis(
        _named(entries["axis"], text.removeprefix("-"), Axis),
        text.startswith("-"),
        _share(entries["dead_zone"]) if "dead_zone" in entries else dead_zone,
        _share(entries["expo"]) if "expo" in entries else expo,
    )


def _buttons(node: Node, action: Action) -> frozenset[Button]:
    """Reads a button, a list of those that are pressed together, or ``none``."""
    nodes = node.items() if node.is_list else [node]
    if not node.is_list and node.text() == _NONE:
        return frozenset()
    buttons = frozenset(_named(each, each.text(), Button) for each in nodes)
    if action in TWO_BUTTONS and len(buttons) < 2:
        raise node.error("needs two buttons together, as [rightshoulder, y]")
    if not buttons:
        raise node.error("expected a button, or none")
    return buttons


def _hold(node: Node) -> Button | None:
    text = node.text()
    return None if text == _NONE else _named(node, text, Button)


def _named(node: Node, text: str, kind: type[E]) -> E:
    known = [str(each.value) for each in kind]
    if text not in known:
        raise node.error(f"expected {', '.join(known)}; got {text!r}")
    return kind(text)
