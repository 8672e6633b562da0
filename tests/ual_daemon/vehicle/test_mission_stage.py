"""Stage of a mission, where the autopilot's report is late or wrong."""

from __future__ import annotations

import pytest

from tests.ual_daemon.flight.hand_made import Autopilot
from tests.ual_daemon.flight.manoeuvres.test_autopilot_mission import Lab
from ual.missions.plan import MissionStage
from ual_daemon.backends.offers.missions import MissionReport
from ual_daemon.backends.values import Control, LandedState
from ual_daemon.vehicle.mission_stage import Brought, estimated_stage

NONE, NOT_STARTED, ACTIVE, PAUSED, COMPLETE = list(MissionStage)[1:]


def assessed(told: MissionStage, mode: str, *, armed: bool = True, lab: Lab | None = None) -> MissionStage:
    """Returns the stage of a mission that is no task, of which a task was the last one."""
    autopilot = Autopilot(control=Control.OTHER, landed=LandedState.IN_AIR, mode=mode, armed=armed)
    last = None if lab is None else lab.mission
    return estimated_stage(MissionReport(told, 1, 1, 0.0, 5), autopilot.snapshot(), "MISSION", None, last)


@pytest.mark.parametrize(
    ("told", "mode", "armed", "stage"),
    [
        (ACTIVE, "OFFBOARD", True, PAUSED),  # for 30 s, as UAL flew a go-to
        (PAUSED, "MISSION", True, ACTIVE),
        (NOT_STARTED, "OFFBOARD", True, NOT_STARTED),
        (ACTIVE, "MISSION", False, NOT_STARTED),
        (COMPLETE, "HOLD", True, COMPLETE),
        (NONE, "MISSION", True, NONE),
        (MissionStage.UNKNOWN, "MISSION", True, MissionStage.UNKNOWN),
    ],
)
def test_the_mode_is_newer_than_what_is_reported(
    told: MissionStage, mode: str, *, armed: bool, stage: MissionStage
) -> None:
    assert assessed(told, mode, armed=armed) is stage


@pytest.mark.parametrize(("armed", "stage"), [(True, PAUSED), (False, NOT_STARTED)])
def test_one_that_did_not_get_to_its_last_item_is_not_complete(*, armed: bool, stage: MissionStage) -> None:
    lab = Lab()
    lab.kept = lab.kept._replace(items=lab.kept.items * 3)
    lab.mission = lab.make()
    assert assessed(COMPLETE, "HOLD", armed=armed, lab=lab) is stage


@pytest.mark.parametrize("told", [NONE, NOT_STARTED, ACTIVE, PAUSED, COMPLETE])
@pytest.mark.parametrize("armed", [True, False])
def test_one_that_was_just_brought_has_not_begun(told: MissionStage, *, armed: bool) -> None:
    """Earlier reports are of another mission: PX4 told COMPLETE, or PAUSED once armed, of a mission nobody flew."""
    autopilot = Autopilot(control=Control.OTHER, landed=LandedState.ON_GROUND, mode="OFFBOARD", armed=armed)
    report = MissionReport(told, 4, 3, 1.0, 5, 1.0)
    brought = Brought(1.5, NOT_STARTED)
    assert estimated_stage(report, autopilot.snapshot(), "MISSION", None, None, brought) is NOT_STARTED


@pytest.mark.parametrize("told", [PAUSED, COMPLETE])
@pytest.mark.parametrize("armed", [True, False])
def test_one_of_which_nothing_was_reached_has_not_begun_on_the_ground(told: MissionStage, *, armed: bool) -> None:
    """PX4 tells the number and the end of the mission before with the new checksum, too."""
    autopilot = Autopilot(control=Control.OTHER, landed=LandedState.ON_GROUND, mode="OFFBOARD", armed=armed)
    for reached, reached_s in ((None, 0.0), (3, 1.0)):
        report = MissionReport(told, 4, reached, 2.0, 5, reached_s)
        brought = Brought(1.5, NOT_STARTED)
        assert estimated_stage(report, autopilot.snapshot(), "MISSION", None, None, brought) is NOT_STARTED


def stage_of(lab: Lab) -> MissionStage:
    return lab.mission.stage(lab.autopilot.snapshot())


def test_a_task_tells_what_it_was_observed_to_do() -> None:
    lab = Lab()
    told = [stage_of(lab)]
    lab.fly()
    told.append(stage_of(lab))
    lab.pause()
    told.append(stage_of(lab))
    report = MissionReport(ACTIVE, 1, None, 0.0, 5)
    assert told == [NOT_STARTED, ACTIVE, PAUSED]
    assert estimated_stage(report, lab.autopilot.snapshot(), "MISSION", lab.mission, lab.mission) is PAUSED


def test_one_that_was_just_started_is_there() -> None:
    """PX4 tells for up to 1 s after an upload that it has none."""
    lab = Lab()
    report = MissionReport(NONE, 1, None, 0.0, 5)
    assert estimated_stage(report, lab.autopilot.snapshot(), "MISSION", lab.mission, lab.mission) is NOT_STARTED
