"""Reads the geofence out of a daemon's configuration file. Needs PyYAML (of the extra ``view``)."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from pathlib import Path

from ual import _discovery
from ual._cli.strict_yaml.loading import YamlFileError
from ual._cli.strict_yaml.nodes import Node, read
from ual._cli.view.fence import Fence
from ual.errors import InvalidArgumentError

_DEFAULT_NS = "uav_1"
_FEWEST_CORNERS = 3


def fences(file: Path) -> list[Fence]:
    """Returns the geofence of each UAV of a configuration file: none, one, or those of a fleet.

    Raises:
        InvalidArgumentError: The file is not a configuration; the message names the line.

    """
    try:
        entries = read(file).entries()
        fence = entries.get("geofence")
        return [] if fence is None else [_fence(ns, fence) for ns in _names(entries)]
    except YamlFileError as error:
        raise InvalidArgumentError(str(error), {"field": "config"}) from None


def _names(entries: Mapping[str, Node]) -> list[str]:
    first = entries["ns"].text() if "ns" in entries else _DEFAULT_NS
    count = entries["fleet"].whole(1) if "fleet" in entries else 1
    base, number = _discovery.split_number(first)
    return [first] if number is None else [f"{base}_{number + i}" for i in range(count)]


def _fence(ns: str, node: Node) -> Fence:
    entries = node.entries()
    is_geo = "polygon_geo" in entries
    polygon = entries.get("polygon_geo", entries.get("polygon"))
    corners = [] if polygon is None else [_corner(each) for each in polygon.items()]
    if polygon is not None and len(corners) < _FEWEST_CORNERS:
        raise polygon.error(f"expected at least {_FEWEST_CORNERS} corners")
    return Fence(
        ns,
        corners,
        entries["frame_id"].text() if "frame_id" in entries else f"{ns}/odom",
        is_geo,
        _height(entries, "min_height_m"),
        _height(entries, "max_height_m"),
    )


def _corner(node: Node) -> tuple[float, float]:
    values = [each.number(-inf) for each in node.items()]
    if len(values) != 2:
        raise node.error("expected two numbers")
    return values[0], values[1]


def _height(entries: Mapping[str, Node], key: str) -> float | None:
    return entries[key].number(-inf) if key in entries else None
