from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import pytest

from tests.rtcm import message
from tests.ual_daemon.program.metrics.scraped import Values
from tests.ual_daemon.stepped import STEP_S, Stepped, at, stepped
from ual.errors import TaskAbortedError
from ual.recording.recorder import QueueFigures
from ual.simulation import BatteryLow, FailsafeTriggered, LinkLost
from ual.types import State
from ual_daemon.backends.offers.corrections import AutopilotCorrections
from ual_daemon.backends.values import LinkReport
from ual_daemon.program.metrics.gathering import ProcessMetrics
from ual_daemon.server.calls import CallFigures
from ual_daemon.server.server import ServerFigures
from ual_daemon.vehicle.planning import PlanFigures

SERVED = ServerFigures(
    CallFigures(2, Counter({"StreamTelemetry": 3}), Counter({"GEOFENCE": 4})), 5, PlanFigures(1, 6, 0.75)
)


class Served:
    def figures(self) -> ServerFigures:
        return SERVED


class Recorded:
    figures = QueueFigures(is_running=True, entries_count=7, size_bytes=2800, lost_count=1)


class Measured:
    """A stepped UAV and its metrics."""

    def __init__(self, uav: Stepped) -> None:
        self.uav = uav
        self._metrics = ProcessMetrics("uav_1", Recorded())
        self._metrics.add(uav.vehicle, Served())

    def values(self) -> Values:
        return Values.of(self._metrics.samples())

    def late(self, by: str = "+Inf") -> float:
        return self.values()("ual_setpoint_lateness_seconds_bucket", le=by)


@pytest.fixture
def measured() -> Iterator[Measured]:
    with stepped() as uav:
        uav.update_each_step()
        yield Measured(uav)


def test_the_state_is_one_of_all(measured: Measured) -> None:
    values = measured.values()
    assert len(values.all("ual_state")) == len(State)
    assert values.labels("ual_state", "state") == ["LANDED_DISARMED"]
    assert (values("ual_up"), values("ual_armed"), values("ual_airborne"), values("ual_flown_by_ual")) == (1, 0, 0, 0)
    measured.uav.fly()
    values = measured.values()
    assert values.labels("ual_state", "state") == ["FLYING_AUTO"]
    assert (values("ual_armed"), values("ual_airborne"), values("ual_flown_by_ual")) == (1, 1, 1)
    assert values("ual_uav_info", backend="light") == 1


def test_setpoints_in_time_are_not_late(measured: Measured) -> None:
    measured.uav.fly()
    before = measured.values()("ual_setpoints_sent_total")
    measured.uav.run(1.0)
    values = measured.values()
    assert values("ual_setpoints_sent_total") - before == 50
    assert measured.late("0.001") == measured.late() > 50
    assert values("ual_setpoint_lateness_seconds_count") == measured.late()


def test_what_is_not_due_on_the_ground_is_not_late_in_the_next_flight(measured: Measured) -> None:
    uav = measured.uav
    for _ in range(2):
        uav.end(uav.prepare.take_off(2.0).begin().future) if uav.is_in(State.LANDED_ARMED) else uav.fly(2.0)
        uav.end(uav.prepare.land().begin().future)
        uav.run(5.0)
        if uav.is_in(State.LANDED_DISARMED):
            uav.arm()
    assert measured.late() == measured.late("0.001") > 100


def test_a_lost_link_is_reported_and_the_setpoints_after_it_are_late(measured: Measured) -> None:
    uav = measured.uav
    uav.fly()
    uav.sim.begin_fault(LinkLost(), 0.9)
    uav.run(0.8)
    values = measured.values()
    assert (values("ual_link_up"), values("ual_airborne"), values("ual_armed")) == (0, 1, 1)
    assert values("ual_link_silence_seconds") == pytest.approx(0.8, abs=2 * STEP_S)
    assert values.labels("ual_state", "state") == ["UNINITIALIZED"]
    uav.run(1.0)
    values = measured.values()
    assert values("ual_link_up") == 1
    assert values("ual_link_silence_seconds") <= STEP_S
    late = [measured.late(by) for by in ("0.2", "0.5", "+Inf")]
    assert [late[-1] - each for each in late] == [1, 0, 0]


def test_tasks_are_counted_by_kind_and_outcome(measured: Measured) -> None:
    uav = measured.uav
    uav.fly()
    first = uav.prepare.go_to_waypoint(at(50.0, 0.0, 3.0)).begin()
    uav.run(1.0)
    assert measured.values()("ual_tasks_running", kind="go_to_waypoint") == 1
    uav.end(uav.prepare.go_to_waypoint(at(1.0, 0.0, 3.0)).begin().future)
    assert isinstance(first.future.exception(), TaskAbortedError)
    values = measured.values()
    assert values("ual_tasks_ended_total", kind="take_off", outcome="succeeded") == 1
    assert values("ual_tasks_ended_total", kind="go_to_waypoint", outcome="succeeded") == 1
    assert values("ual_tasks_ended_total", kind="go_to_waypoint", outcome="aborted") == 1
    assert values.all("ual_tasks_running") == []


def test_the_battery_is_a_ratio_in_base_units(measured: Measured) -> None:
    measured.uav.fly()
    measured.uav.sim.begin_fault(BatteryLow(10.0))
    measured.uav.run(0.1)
    assert measured.values()("ual_battery_remaining_ratio") == pytest.approx(0.1, abs=0.01)


def test_the_fix_and_the_age_of_the_corrections(measured: Measured) -> None:
    assert measured.values().all("ual_gps_corrections_age_seconds") == []
    offer = measured.uav.vehicle.offer(AutopilotCorrections)  # type: ignore[type-abstract]  # it is only looked for
    assert offer is not None
    offer.inject(message(100))
    measured.uav.run(2.0)
    values = measured.values()
    assert (values("ual_gps_fix", fix="FIX_3D"), values("ual_gps_fix", fix="RTK_FIXED")) == (1, 0)
    assert values("ual_gps_corrections_age_seconds") == pytest.approx(2.0, abs=0.2)


def test_a_failsafe_is_there_only_while_it_is_active(measured: Measured) -> None:
    measured.uav.fly()
    assert measured.values().all("ual_failsafe") == []
    measured.uav.sim.begin_fault(FailsafeTriggered("battery failsafe"))
    measured.uav.run(0.5)
    assert measured.values()("ual_failsafe", cause="battery failsafe") == 1


def test_what_the_server_measures(measured: Measured) -> None:
    values = measured.values()
    assert values("ual_callers") == 2
    assert values("ual_streams", method="StreamTelemetry") == 3
    assert values("ual_failed_calls_total", reason="GEOFENCE") == 4
    assert values("ual_stream_samples_missed_total") == 5
    assert values("ual_plans_running") == 1
    assert (values("ual_plan_seconds_count"), values("ual_plan_seconds_sum")) == (6, 0.75)


def test_the_process_and_its_recorder(measured: Measured) -> None:
    values = measured.values()
    assert values("ual_process_cpu_seconds_total", process="uav_1") > 0.0
    assert values("ual_process_resident_memory_bytes") > 1e6
    assert values("ual_recorder_queue_entries", process="uav_1") == 7
    assert (values("ual_recorder_running"), values("ual_recorder_lost_entries_total")) == (1, 1)


def test_only_what_the_link_measures_has_a_value(measured: Measured, monkeypatch: pytest.MonkeyPatch) -> None:
    assert measured.values().all("ual_link_rate_hertz") == []
    monkeypatch.setattr(measured.uav.vehicle.backend, "link", lambda: LinkReport(120.0, 0.02, None, 3, 0))
    values = measured.values()
    assert (values("ual_link_rate_hertz"), values("ual_link_loss_ratio")) == (120.0, 0.02)
    assert (values("ual_link_losses_total"), values("ual_autopilot_reboots_total")) == (3, 0)
    assert values.all("ual_link_round_trip_seconds") == []
