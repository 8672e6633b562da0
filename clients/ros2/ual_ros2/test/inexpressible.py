"""The conformance checks that cannot be done over ROS, each with its reason. It needs no ROS.

docs/reference/clients/ros2.md lists them, too; a test compares both.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


class InexpressibleError(Exception):
    """The interface in ROS has nothing for a member of `ual.interface.Uav`. The message names the member."""


@dataclass(frozen=True)
class Inexpressible:
    """Why a check cannot be done, and what it says then, as a regular expression."""

    why: str
    says: str


_WHOLE_LOGS = Inexpressible("a log is downloaded into a file, and from its beginning", "^offset$")
_NO_RATE = Inexpressible("the node has one `rate_hz` for all subscribers", "^rate_hz$")

INEXPRESSIBLE: Mapping[str, Inexpressible] = {
    "a_slow_rate_leaves_out_samples": _NO_RATE,
    "lists_the_autopilots_logs": _WHOLE_LOGS,
    "downloads_a_log": _WHOLE_LOGS,
}
