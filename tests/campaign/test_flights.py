"""Flights of the campaign on the test autopilots: a good daemon passes, and one that fights the pilot is found."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import cast

import pytest

from tests.campaign.__main__ import begin_anew, require_at_origin
from tests.campaign.evidence import Case
from tests.campaign.flight import fly
from tests.campaign.judge import judge
from tests.campaign.plan import OURS, PAUSE, Fault, Plan, Step
from tests.campaign.positions import Origin
from tests.campaign.processes import FlightFailedError
from tests.campaign.record import DAEMON_KILLED, DAEMON_STARTED
from tests.campaign.rig import Options, Rig
from tests.ports import free_port
from tests.simulators.process import autopilot_process
from tests.sitl.copter_pilot import CopterPilot
from tests.sitl.pilot import SafetyPilot

HOST = "127.0.0.1"
STEPS = (Step("arm"), Step("take_off", (2.5,)), Step("go_to", (4.0, 1.0, 3.0)), Step("land"))
TAKE_OVER = Plan(0, OURS, "pilot", STEPS, (Fault("pilot", 2, 0.3, 1.5, 0.0),))
TO_AND_FRO = Step("path", (9.0, 0.0, 3.0, -9.0, 0.0, 3.0, 9.0, 0.0, 3.0))
BREACH = Plan(0, OURS, "pilot", (*STEPS[:2], TO_AND_FRO, STEPS[3]), (Fault("fence", 2, 0.0, 1.5, 0.0),))
BLIND = Plan(0, OURS, "pilot", STEPS, (Fault("ekf", 2, 0.3, 1.5, 0.0),))
LINE, FAST = Step("velocity", (-0.8, -0.4, 0.0, 4.5)), Step("velocity", (5.0, 0.0, 0.0, 4.5))
BOUNDED = Plan(
    0,
    OURS,
    "client",
    (*STEPS[:2], LINE, FAST, STEPS[3]),
    (Fault("wide_fence", 2, 0.0, 6.0, 0.75), Fault("limits", 3, 0.2, 2.5, 0.0)),
)
MISSION = (Step("upload", (4.0, 1.0, 3.0, -4.0, 1.0, 3.0, 4.0, 1.0, 3.0)), Step("mission", (float(PAUSE), 0.5)))
RESTART = Plan(
    0,
    OURS,
    "client",
    (*STEPS[:2], *MISSION, *STEPS[2:]),
    (Fault("station_upload", 3, 4.0, 0.0, 0.0), Fault("kill_daemon", 4, 0.3, 0.2, 0.0)),
)


@contextmanager
def ardupilot(folder: Path, mutant: str = "") -> Iterator[Rig]:
    with autopilot_process("ardupilot", "--tcp", "0", "--ground", "0", "--other", "0") as ports:
        url, truth_url = (f"tcp://{HOST}:{ports[name]}" for name in ("link", "other"))
        pilot = partial(CopterPilot, HOST, ports["ground"], sticks_port=ports["radio"])
        origin = Origin(47.3977420, 8.5455940, 488.100)
        rig = Rig(Options("ardupilot", url, pilot, truth_url, "", folder, origin, mutant))
        yield rig
        rig.close()


@contextmanager
def px4(folder: Path) -> Iterator[Rig]:
    port, truth_port = free_port(), free_port()
    with autopilot_process("px4", "--udp", str(port), "--ground", "0", "--other", str(truth_port)) as ports:
        urls = [f"udpin://{HOST}:{each}" for each in (port, truth_port)]
        pilot = partial(SafetyPilot, HOST, ports["ground"], local_port=0)
        origin = Origin(47.3977428, 8.5455967, 489.052)
        rig = Rig(Options("px4", urls[0], pilot, urls[1], "", folder, origin))
        yield rig
        rig.close()


def test_a_flight_that_the_pilot_takes_over_is_clean(tmp_path: Path) -> None:
    with ardupilot(tmp_path) as rig:
        record = fly(rig, TAKE_OVER)
    assert judge(record) == []
    assert Case(record).taken_s
    assert {"TAKING_OFF", "FLYING_MANUAL", "LANDED_DISARMED"} <= {said.state for said in record.said}
    assert max(each.place[2] for each in record.truth) > 1.0


def test_a_flight_whose_daemon_is_killed_and_whose_mission_is_replaced_is_clean(tmp_path: Path) -> None:
    with px4(tmp_path) as rig:
        record = fly(rig, RESTART)
    assert judge(record) == []
    assert [life.what for life in record.lives] == [DAEMON_STARTED, DAEMON_KILLED, DAEMON_STARTED]
    assert ("mission", "TASK_ABORTED") in {(call.name, call.outcome) for call in record.called}
    assert record.said[-1].state == "LANDED_DISARMED"


def test_a_flight_that_the_autopilots_fence_ends_is_clean(tmp_path: Path) -> None:
    with ardupilot(tmp_path) as rig:
        record = fly(rig, BREACH)
    assert judge(record) == []
    # The daemon is told of the fence: where the way leads out, the task ends by that, and else by the breach.
    is_breached = "fence" in {call.by for call in record.called} and Case(record).taken_s
    assert is_breached or "GEOFENCE" in {call.outcome for call in record.called}


def test_a_velocity_leads_straight_and_keeps_to_limits_and_a_fence_that_are_new(tmp_path: Path) -> None:
    with ardupilot(tmp_path) as rig:
        record = fly(rig, BOUNDED)
    assert judge(record) == []
    told = {(value.name, value.value) for value in record.values}
    assert {("WPNAV_SPEED", 150.0), ("WPNAV_SPEED", 1000.0), ("FENCE_RADIUS", 8.0), ("FENCE_ENABLE", 1.0)} <= told
    assert max(abs(each.place[0]) for each in record.truth) > 1.0


def test_a_flight_that_loses_its_position_is_clean(tmp_path: Path) -> None:
    with px4(tmp_path) as rig:
        record = fly(rig, BLIND)
    assert judge(record) == []
    assert {call.by for call in record.called} & {"position failsafe", "autopilot"}
    assert "UNINITIALIZED" in {said.state for said in record.said}


def test_a_daemon_that_goes_on_sending_after_the_take_over_is_found(tmp_path: Path) -> None:
    with ardupilot(tmp_path, "stubborn") as rig:
        record = fly(rig, TAKE_OVER)
    # Where the computer is too busy to say since when the take-over was known, the other rule finds it.
    assert {"take-over", "unasked"} & {breach.rule for breach in judge(record)}


def test_a_vehicle_that_is_not_at_its_origin_flies_no_campaign() -> None:
    """The fence refused sixty take-offs of one at the other end of the Earth, and each flight counted as idle."""
    require_at_origin(None)
    require_at_origin((3.0, -4.0, 5.0))
    with pytest.raises(SystemExit, match="10000 km from --origin"):
        require_at_origin((6.0e6, -8.0e6, 100.0))


class _Stuck:
    """A rig whose vehicle does not come down, in a simulator that is well once it was started anew."""

    def __init__(self) -> None:
        self.simulator = object()
        self.done: list[str] = []

    def bring_down(self) -> None:
        raise FlightFailedError("it could not be landed: UNINITIALIZED")

    def reboot(self) -> None:
        self.done.append("reboot")
        if len(self.done) < 2:
            raise OSError("the simulator does not listen")


def test_a_simulator_that_cannot_be_brought_down_is_started_anew() -> None:
    """Seventeen flights were not flown after one that could not be landed."""
    rig = _Stuck()
    begin_anew(cast("Rig", rig))
    assert rig.done == ["reboot", "reboot"]
