"""Names the fields of a request as ROS has them. It needs no ROS: requests are known by their fields."""

from __future__ import annotations

import re

from ual_ros2.messages import Message

_UNIT = re.compile(r"_(?:m_s|m|s|rad|deg)(?=$|[.\[])")
"""UAL's names end in their unit. Those of ROS do not."""
_INDEX = re.compile(r"\[.*")


def field_of(request: Message, field: str) -> str:
    """Returns the name in a request of what UAL calls `field`; the same where the request has nothing of that name.

    ``height_m`` is ``height`` in ROS, and ``latitude_deg`` is ``waypoint.latitude``.
    """
    if _has(request, field):
        return field
    named = _UNIT.sub("", field)
    if _has(request, named):
        return named
    return f"waypoint.{named}" if _has(getattr(request, "waypoint", None), named) else field


def in_text(text: str, field: str, named: str) -> str:
    """Returns a text with the name that ROS has for a field."""
    return re.sub(rf"(?<![\w.]){re.escape(field)}(?!\w)", lambda _: named, text)


def _has(message: Message, field: str) -> bool:
    """Whether a message has a field, or one in an array of messages, by its path."""
    for part in field.split("."):
        name = _INDEX.sub("", part)
        if not hasattr(message, name):
            return False
        message = getattr(message, name)
        if name != part:
            message = next(iter(message), None) if hasattr(message, "__iter__") else None
    return True
