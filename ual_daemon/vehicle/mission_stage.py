"""Mission stage: the autopilot's report, corrected by its mode, the task, and the items that were reached.

PX4 tells ACTIVE after a mission was left, or in a landing of UAL, and COMPLETE at each disarming. Its word may be 1.8 s
old.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ual.missions.plan import MissionStage
from ual_daemon.backends.offers.missions import MissionReport
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.manoeuvres.autopilot_mission import AutopilotMission


class Brought(NamedTuple):
    """Last change that UAL made to the autopilot's mission: its time, and the stage since."""

    time_s: float = -math.inf
    stage: MissionStage = MissionStage.UNKNOWN

    def reached(self, report: MissionReport) -> int | None:
        """Returns the item of this mission that was reached last; None if none was."""
        return None if report.reached_s < self.time_s else report.reached


_BEFORE = Brought()


def estimated_stage(
    report: MissionReport,
    snapshot: Snapshot,
    mode: str,
    flown: AutopilotMission | None,
    last: AutopilotMission | None,
    brought: Brought = _BEFORE,
) -> MissionStage:
    """Returns the stage.

    Args:
        report: What the autopilot tells.
        snapshot: What is known of it.
        mode: The name of the mode in which it flies missions.
        flown: The mission that it flies as a task; None where there is none.
        last: The mission of UAL that it has, flown now or before; None where there was none.
        brought: What UAL has brought last. What was reported before is of another mission.

    """
    told, control = report.stage, snapshot.control
    is_flown = control.armed is not None and control.armed.value and control.mode_name == mode
    if flown is None and not is_flown and told is not MissionStage.UNKNOWN and report.time_s <= brought.time_s:
        return brought.stage
    if told is MissionStage.UNKNOWN or (told is MissionStage.NONE and flown is None):
        return told
    # PX4 tells the number and the end of the mission before also once it has another one.
    has_begun = last is not None or not control.is_on_ground or brought.reached(report) is not None
    is_complete = told is MissionStage.COMPLETE and (has_begun if last is None else last.is_at_last(report))
    if flown is not None:
        stage = flown.stage(snapshot)
        return MissionStage.COMPLETE if is_complete and stage is MissionStage.ACTIVE else stage
    if control.armed is None or control.mode is None:
        return told
    if is_flown:
        is_waiting = told is MissionStage.NOT_STARTED and control.is_on_ground
        return told if is_waiting or is_complete else MissionStage.ACTIVE
    if is_complete or (last is not None and last.has_succeeded):
        return MissionStage.COMPLETE
    is_at_first = told is MissionStage.NOT_STARTED and report.item in (None, 1)  # ArduPilot tells no pause
    is_new = is_at_first or not control.armed.value or not has_begun  # once disarmed both begin again
    return MissionStage.NOT_STARTED if is_new else MissionStage.PAUSED
