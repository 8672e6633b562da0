"""What a mission would be, by a dry run; and how far the autopilot is with its mission."""

from __future__ import annotations

from ual.contract.mission import LinkLossAction, MissionPlan, MissionProgress, MissionStage, StoredMission

__all__ = ["LinkLossAction", "MissionPlan", "MissionProgress", "MissionStage", "StoredMission"]
