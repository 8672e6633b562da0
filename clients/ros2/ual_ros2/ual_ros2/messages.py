"""Types of ROS for a type checker without ROS: all of them are unknown. This is the one place that says so."""

from __future__ import annotations

from typing import Any, TypeAlias

Message: TypeAlias = Any
"""A message, request, response, goal, feedback or result."""
Entity: TypeAlias = Any
"""A node, or what belongs to one: a publisher, a service, a clock, a goal's handle."""
