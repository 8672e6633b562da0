"""Diagnostics of a UAV. It needs no ROS."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import ual
from ual_ros2 import senders

OK, WARN, ERROR = 0, 1, 2
"""The levels of ``diagnostic_msgs/DiagnosticStatus``."""


@dataclass
class ConnectionReport:
    """Connection to one UAV as the node itself knows it."""

    address: str = ""
    lease: str = "none"
    refused: str = ""
    """The last setpoint or pose from outside that was refused, while that stands: reason and words."""
    refused_count: int = 0
    failed: str = ""
    """Why a part of the node does not work any more: a mistake in this program."""
    clock: str = ""
    """Fault of ROS' time."""
    other_nodes: int = 0
    """Other nodes that offer this UAV in ROS, too."""
    velocity_senders: tuple[str, ...] = ()
    """The nodes that publish velocities for it."""

    @property
    def lacking_lease(self) -> str:
        """Why what flies is refused; empty where it is not."""
        return "" if self.lease in ("none", "held") else f"lease {self.lease}"

    @property
    def rivals(self) -> str:
        """Effect of other nodes of this UAV on its callers; empty where there is none."""
        if not self.other_nodes:
            return ""
        return (
            f"{self.other_nodes} more node(s) offer this UAV: each flies each goal, and replaces that of the other. "
            "End all but one. (One that was killed is seen for up to 20 s.)"
        )


@dataclass(frozen=True)
class Status:
    """One status: how bad, in words, and all values."""

    level: int
    message: str
    values: Mapping[str, str] = field(default_factory=dict)


def of(sample: ual.Telemetry, said: ConnectionReport) -> Status:
    """Makes the status of a sample. The worst that is known comes first."""
    about = sample.health
    worst = [
        (ERROR, said.failed),
        (ERROR, sample.state_reason if sample.state is ual.State.UNINITIALIZED else ""),
        (ERROR, sample.frame_lost),
        (ERROR, f"failsafe: {about.failsafe}" if about is not None and about.failsafe else ""),
        (WARN, said.rivals),
        (WARN, senders.doubt(said.velocity_senders)),
        (WARN, said.lacking_lease),
        (WARN, said.clock),
        (WARN, f"refused: {said.refused}" if said.refused else ""),
        (WARN, "; ".join(about.failing_checks) if about is not None else ""),
    ]
    level, message = next(((level, text) for level, text in worst if text), (OK, sample.state.name))
    return Status(level, message, {**_of_sample(sample), **_of_node(said)})


def silent(reason: str, said: ConnectionReport) -> Status:
    """Makes the status of a UAV of which nothing is heard."""
    return Status(ERROR, reason, _of_node(said))


def _of_sample(sample: ual.Telemetry) -> dict[str, str]:
    about = sample.health or ual.types.Health()
    return {
        "state": sample.state.name,
        "state_reason": sample.state_reason,
        "flight_mode": sample.flight_mode,
        "armed": str(sample.armed).lower(),
        "ready_to_arm": "unknown" if about.is_ready_to_arm is None else str(about.is_ready_to_arm).lower(),
        "failing_checks": "; ".join(about.failing_checks),
        "failsafe": about.failsafe,
        "held_by": about.held_by,
        "link_quality": "unknown" if about.link_quality is None else f"{about.link_quality:.3f}",
        "status_text": sample.status_text,
        "frame_lost": sample.frame_lost,
    }


def _of_node(said: ConnectionReport) -> dict[str, str]:
    return {
        "address": said.address,
        "lease": said.lease,
        "other_nodes": str(said.other_nodes),
        "velocity_senders": " ".join(said.velocity_senders),
        "refused": said.refused,
        "refused_count": str(said.refused_count),
    }
