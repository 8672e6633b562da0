"""Missions as ground stations write them."""

from __future__ import annotations

import json
from typing import Any

PX4, ARDUPILOT = 12, 3


def item(command: float, params: list[float | None], frame: int = 3, **more: Any) -> dict[str, Any]:
    return {"type": "SimpleItem", "command": command, "frame": frame, "params": params, **more}


def waypoint(
    lat: float | None = 47.1,
    lon: float | None = 8.1,
    alt: float | None = 20,
    *,
    yaw: float | None = None,
    hold: float = 0.0,
    frame: int = 3,
    **more: Any,
) -> dict[str, Any]:
    return item(16, [hold, 0, 0, yaw, lat, lon, alt], frame, **more)


def do(command: float, *params: float | None) -> dict[str, Any]:
    return item(command, [*params, *[0] * (7 - len(params))], frame=2)


def plan(*items: dict[str, Any], firmware: int | None = None, vehicle: int = 2, **more: Any) -> str:
    """A plan; its items are numbered for jumps as QGroundControl does."""
    numbered = [{"doJumpId": number, **each} for number, each in enumerate(items, start=1)]
    mission: dict[str, Any] = {"items": numbered, "hoverSpeed": 5, "vehicleType": vehicle}
    if firmware is not None:
        mission["firmwareType"] = firmware
    return json.dumps({"fileType": "Plan", "version": 1, "mission": mission, **more})


def wpl(*items: tuple[float | str, ...], version: int = 110) -> str:
    """A waypoint file of Mission Planner: each item has frame, command, four parameters and a position."""
    lines = [f"QGC WPL {version}"]
    lines += ["\t".join(map(str, (number, int(number == 0), *each, 1))) for number, each in enumerate(items)]
    return "\r\n".join(lines) + "\r\n"
