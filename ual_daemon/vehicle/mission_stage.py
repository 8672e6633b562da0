"""How far a mission is: the autopilot's word, judged by its mode, the task, and the items that were reached.

PX4 tells ACTIVE after a mission was left, or in a landing of UAL, and COMPLETE at each disarming. Its word may be 1.8 s
old.
"""

from __future__ import annotations

from ual.missions.plan import MissionStage
from ual_daemon.backends.offers.missions import MissionReport
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.manoeuvres.autopilot_mission import AutopilotMission

_NOT_JUDGED = (MissionStage.UNKNOWN, MissionStage.NONE)


def judged_stage(
    report: MissionReport, snapshot: Snapshot, mode: str, flown: AutopilotMission | None, last: AutopilotMission | None
) -> MissionStage:
    """Returns the stage.

    Args:
        report: What the autopilot tells.
        snapshot: What is known of it.
        mode: The name of the mode in which it flies missions.
        flown: The mission that it flies as a task; None where there is none.
        last: The mission of UAL that it has, flown now or before; None where there was none.

    """
    told = report.stage
    if told in _NOT_JUDGED:
        return told
    is_complete = told is MissionStage.COMPLETE and (last is None or last.is_at_last(report))
    if flown is not None:
        stage = flown.stage(snapshot)
        return MissionStage.COMPLETE if is_complete and stage is MissionStage.ACTIVE else stage
    control = snapshot.control
    if control.armed is None or control.mode is None:
        return told
    if control.armed.value and control.mode_name == mode:
        is_waiting = told is MissionStage.NOT_STARTED and control.is_on_ground
        return told if is_waiting or is_complete else MissionStage.ACTIVE
    if is_complete or (last is not None and last.has_succeeded):
        return MissionStage.COMPLETE
    is_at_first = told is MissionStage.NOT_STARTED and report.item in (None, 1)  # ArduPilot tells no pause
    is_new = is_at_first or not control.armed.value  # once disarmed both begin anew
    return MissionStage.NOT_STARTED if is_new else MissionStage.PAUSED
