"""Names the fields of a request as ROS has them. It needs no ROS: requests are known by their fields."""

from __future__ import annotations

import re
from itertools import product

from ual_ros2.derived.names import NAMES
from ual_ros2.messages import Message

_INDEX = re.compile(r"\[.*")


def field_of(request: Message, field: str) -> str:
    """Returns the name in a request of what UAL calls `field`; the same where the request has nothing of that name.

    ``height_m`` is ``height`` in ROS, and ``latitude_deg`` is ``waypoint.latitude``.
    """
    named = (".".join(parts) for parts in product(*map(_named, field.split("."))))
    return next((each for each in named if _has(request, each)), field)


def _named(part: str) -> tuple[str, ...]:
    """Returns what a part of a path may be called: as UAL has it, or as the requests of ROS."""
    name = _INDEX.sub("", part)
    return (part, *(f"{each}{part[len(name) :]}" for each in NAMES.get(name, ())))


def in_text(text: str, field: str, named: str) -> str:
    """Returns a text with the name that ROS has for a field."""
    return re.sub(rf"(?<![\w.]){re.escape(field)}(?!\w)", lambda _: named, text)


def _has(message: Message, field: str) -> bool:
    """Returns whether a message has a field, or one in an array of messages, by its path."""
    for part in field.split("."):
        name = _INDEX.sub("", part)
        if not hasattr(message, name):
            return False
        message = getattr(message, name)
        if name != part:
            message = next(iter(message), None) if hasattr(message, "__iter__") else None
    return True
