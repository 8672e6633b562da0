"""Cause of a mode: a failsafe for missing setpoints has one name, however long the pause was."""

from __future__ import annotations

import struct

import pytest

from ual_daemon.backends.firmwares.ardupilot import ArduCopter
from ual_daemon.backends.firmwares.autopilot import Autopilot
from ual_daemon.backends.firmwares.cause_watch import CauseWatch
from ual_daemon.backends.firmwares.numbers import Sensor, SystemStatus
from ual_daemon.backends.firmwares.px4 import Px4
from ual_daemon.backends.firmwares.px4_events import event_id, read
from ual_daemon.backends.firmwares.setpoint_monitor import SetpointMonitor
from ual_daemon.backends.values import Cause, LandedState, Sample, Snapshot
from ual_daemon.flight.manoeuvres.manoeuvre import taken_over

OFFBOARD, POSCTL, RTL, HOLD = 6 << 16, 3 << 16, 4 << 16 | 5 << 24, 4 << 16 | 3 << 24
WARNING = 0x33
IN_OFFBOARD, IN_ANY = struct.pack("<I", 1 << 14), b"\xff" * 4
"""The modes that a check concerns, as recorded."""
STEP_S = 0.02


class Px4Watch:
    """The causes that a PX4 shows, with a stream of setpoints to it at 50 Hz."""

    def __init__(
        self, loss_s: float = 0.3, autopilot: Autopilot | None = None, *, names_intended_mode: bool = True
    ) -> None:
        self.now_s = 0.0
        self.sent = SetpointMonitor()
        self.autopilot = Px4() if autopilot is None else autopilot
        self.causes = CauseWatch(
            self.autopilot, self.sent, names_intended_mode=names_intended_mode, setpoints_lost_s=lambda: loss_s
        )
        self.names_intended_mode = names_intended_mode
        self.mode = self.intended = OFFBOARD

    def pass_s(self, duration_s: float, *, is_sending: bool, is_heard: bool = True) -> Cause | None:
        held_by = None
        for _ in range(round(duration_s / STEP_S)):
            self.now_s += STEP_S
            if is_sending:
                self.sent.on_sent(self.now_s)
            if is_heard:
                held_by = self.tell()
        return held_by

    def tell(self, *, is_armed: bool | None = True) -> Cause | None:
        if self.names_intended_mode:
            self.causes.on_intention(self.mode, self.intended, self.now_s)
        return self.causes.held_by(self.autopilot.mode(self.mode), self.now_s, is_armed=is_armed)

    def event(self, name: str, arguments: bytes) -> None:
        mode = self.autopilot.mode(self.mode).name
        found = read(event_id(name), self.now_s, WARNING, arguments.ljust(40, b"\0"), mode)
        self.causes.on_sign(found.cause, self.now_s, lasting=found.lasting)


@pytest.mark.parametrize("names_intended_mode", [True, False])
@pytest.mark.parametrize("loses", [POSCTL, RTL])
@pytest.mark.parametrize("pause_s", [0.34, 0.4, 0.46, 0.52, 0.7, 1.0, 1.6, 5.0])
def test_a_failsafe_for_a_pause_of_this_computer_is_for_missing_setpoints_however_long_it_was(
    pause_s: float, loses: int, *, names_intended_mode: bool
) -> None:
    """With a COM_OF_LOSS_T of 0.3 it had three names. In the pause, nothing is heard either: no event names it."""
    watch = Px4Watch(names_intended_mode=names_intended_mode)
    watch.pass_s(5.0, is_sending=True)
    watch.pass_s(pause_s, is_sending=False, is_heard=False)
    watch.mode = loses
    watch.tell(is_armed=None)  # the mode may be known before whether it is armed
    watch.pass_s(0.8, is_sending=False)
    watch.causes.on_system_status(SystemStatus.CRITICAL, watch.now_s)  # as late as PX4 says so
    assert watch.pass_s(0.1, is_sending=False) is Cause.SETPOINTS


@pytest.mark.parametrize(("switched_s", "cause"), [(0.5, Cause.SAFETY_PILOT), (None, None)])
def test_a_switch_after_our_next_command_chose_the_mode_of_the_one_before(
    switched_s: float | None, cause: Cause | None
) -> None:
    """A mission is stopped, and the pilot selects its mode again at once; or our first command comes late."""
    watch = Px4Watch(autopilot=ArduCopter(), names_intended_mode=False)
    auto, brake = 3, 17
    watch.mode = auto
    watch.causes.on_rc_channels([1500] * 8, watch.now_s)
    watch.causes.on_own_command("AUTO", watch.now_s)
    watch.pass_s(1.0, is_sending=False)
    watch.causes.on_own_command("BRAKE", watch.now_s)
    watch.mode = brake
    watch.pass_s(0.5, is_sending=False)
    if switched_s is not None:
        watch.causes.on_rc_channels([1500] * 5 + [1100] * 3, watch.now_s)
    watch.mode = auto
    assert watch.pass_s(1.0, is_sending=False) is cause


def test_a_hold_that_comes_again_after_ours_has_ended_is_not_ours() -> None:
    """A mission was paused and resumed, and cleared by another station: the safety pilot was named."""
    watch = Px4Watch()
    mission = 4 << 16 | 4 << 24
    watch.mode = watch.intended = mission
    watch.pass_s(5.0, is_sending=False)
    for ours, mode in (("AUTO.LOITER", HOLD), ("AUTO.MISSION", mission)):
        watch.causes.on_own_command(ours, watch.now_s)
        watch.mode = watch.intended = mode
        assert watch.pass_s(1.2, is_sending=False) is None
    watch.mode = watch.intended = HOLD
    assert watch.pass_s(1.0, is_sending=False) is Cause.GROUND_STATION


@pytest.mark.parametrize("autopilot", [Px4(), ArduCopter()])
@pytest.mark.parametrize(
    ("after_s", "is_switched", "cause"),
    [
        (0.2, False, Cause.AUTOPILOT),
        (0.8, False, Cause.AUTOPILOT),
        (0.2, True, Cause.SAFETY_PILOT),
        (1.2, False, Cause.GROUND_STATION),
        (None, False, Cause.GROUND_STATION),
    ],
)
def test_a_hold_just_after_an_order_about_the_mission_is_the_autopilots(
    autopilot: Autopilot, after_s: float | None, cause: Cause, *, is_switched: bool
) -> None:
    """ArduCopter stays in the mode of its mission: another one is always chosen."""
    is_px4 = isinstance(autopilot, Px4)
    watch = Px4Watch(autopilot=autopilot, names_intended_mode=is_px4)
    watch.mode = watch.intended = 4 << 16 | 4 << 24 if is_px4 else 3
    watch.pass_s(5.0, is_sending=False)
    watch.causes.on_rc_channels([1500] * 8, watch.now_s)
    if after_s is not None:
        watch.causes.on_own_order(watch.now_s)
        watch.pass_s(after_s, is_sending=False)
    if is_switched:
        watch.causes.on_rc_channels([1500] * 5 + [1100] * 3, watch.now_s)
    watch.mode = watch.intended = HOLD if is_px4 else 17
    found = watch.pass_s(1.0, is_sending=False)
    assert found is (cause if is_px4 or is_switched else Cause.GROUND_STATION)


@pytest.mark.parametrize(
    ("told_s", "is_on_mission", "cause"),
    [
        (-0.8, True, Cause.AUTOPILOT),
        (0.2, True, Cause.AUTOPILOT),
        (1.0, True, Cause.AUTOPILOT),  # a ground station was named for a moment
        (3.0, True, Cause.GROUND_STATION),
        (None, True, Cause.GROUND_STATION),
        (-0.8, False, Cause.GROUND_STATION),  # it was complete long before
    ],
)
def test_a_hold_as_the_mission_is_complete_is_the_autopilots(
    told_s: float | None, cause: Cause, *, is_on_mission: bool
) -> None:
    watch = Px4Watch()
    watch.mode = watch.intended = 4 << 16 | 4 << 24 if is_on_mission else OFFBOARD
    held_by = None
    for step in range(500):
        if step == 300:
            watch.mode = watch.intended = HOLD
        if told_s is not None and step == 300 + round(told_s / STEP_S):
            watch.causes.on_mission_report(watch.now_s, is_complete=True)
        held_by = watch.pass_s(STEP_S, is_sending=True)
    assert held_by is cause


@pytest.mark.parametrize(
    ("told_s", "is_complete", "cause", "by_s"),
    [
        (0.7, True, Cause.AUTOPILOT, 0.75),
        (0.05, False, Cause.GROUND_STATION, 0.45),
        (0.7, False, Cause.GROUND_STATION, 0.75),
        (None, False, Cause.GROUND_STATION, 0.95),
    ],
)
def test_a_hold_after_a_mission_is_nobodys_until_its_end_is_reported_or_not(
    told_s: float | None, cause: Cause, by_s: float, *, is_complete: bool
) -> None:
    """Campaign, 1710000000078: the last two items were reached at once, and the end came 0.4 s after the mode."""
    watch = Px4Watch()
    watch.mode = watch.intended = 4 << 16 | 4 << 24
    watch.causes.on_mission_report(watch.now_s, is_complete=False)
    watch.pass_s(2.0, is_sending=False)
    watch.mode = watch.intended = HOLD
    found: list[Cause | None] = []
    for step in range(100):
        if told_s is not None and step == round(told_s / STEP_S):
            watch.causes.on_mission_report(watch.now_s, is_complete=is_complete)
        found.append(watch.pass_s(STEP_S, is_sending=False))
        assert watch.causes.take_report_request() is (step == 0)
    decided_at = next(step for step, each in enumerate(found) if each is not Cause.OPEN)
    assert decided_at * STEP_S <= by_s
    assert set(found[decided_at:]) == {cause}


@pytest.mark.parametrize(
    ("after_s", "by", "text"),
    [
        (2.0, "autopilot", "the autopilot follows a command of UAL from before"),
        (6.0, "ground station", "the ground station took over"),
        (None, "ground station", "the ground station took over"),
    ],
)
def test_a_landing_of_ours_that_comes_late_names_nobody_else(after_s: float | None, by: str, text: str) -> None:
    """A go-to had begun meanwhile: it ended as if the safety pilot had taken over."""
    watch = Px4Watch()
    watch.pass_s(5.0, is_sending=True)
    if after_s is not None:
        watch.causes.on_own_command("AUTO.LAND", watch.now_s)
        watch.pass_s(after_s, is_sending=True)
    watch.mode = watch.intended = 4 << 16 | 6 << 24
    watch.pass_s(1.0, is_sending=True)
    armed, landed = Sample(True, watch.now_s), Sample(LandedState.LANDING, watch.now_s)
    mode = Sample(watch.autopilot.mode(watch.mode), watch.now_s)
    control = watch.causes.control_state(armed, landed, mode, "", watch.now_s)
    error = taken_over(Snapshot(watch.now_s, control=control), "go_to_waypoint")
    assert text in error.message
    assert error.metadata["by"] == by
    watch.mode = watch.intended = OFFBOARD
    watch.pass_s(1.0, is_sending=True)
    mode = Sample(watch.autopilot.mode(watch.mode), watch.now_s)
    assert not watch.causes.control_state(armed, landed, mode, "", watch.now_s).is_of_command


def test_a_pilot_who_takes_over_in_a_pause_is_named() -> None:
    watch = Px4Watch(names_intended_mode=False)
    watch.pass_s(5.0, is_sending=True)
    watch.pass_s(0.6, is_sending=False, is_heard=False)
    watch.mode = POSCTL
    assert watch.pass_s(1.0, is_sending=False) is Cause.OPEN
    assert watch.pass_s(0.5, is_sending=False) is Cause.SAFETY_PILOT


def test_a_pilot_who_takes_over_without_a_pause_is_named_at_once() -> None:
    watch = Px4Watch(names_intended_mode=False)
    watch.pass_s(5.0, is_sending=True)
    watch.mode = POSCTL
    assert watch.tell() is Cause.SAFETY_PILOT


@pytest.mark.parametrize("name", ["check_modes_offboard_signal", "check_modes_offboard_signal_lost"])
@pytest.mark.parametrize("names_intended_mode", [True, False])
@pytest.mark.parametrize("stops_s", [0.3, 2.0])
def test_missing_setpoints_are_named_by_px4s_own_event(stops_s: float, name: str, *, names_intended_mode: bool) -> None:
    """As recorded with 1.17: the event comes 10 ms before the failsafe, whose own has no cause. 1.18 renames it."""
    watch = Px4Watch(loss_s=1e9, names_intended_mode=names_intended_mode)
    watch.pass_s(5.0, is_sending=True)
    watch.pass_s(stops_s, is_sending=False)
    watch.event(name, IN_OFFBOARD)
    watch.event("commander_failsafe_enter_generic", bytes.fromhex("0000060002"))
    watch.mode = POSCTL
    assert watch.tell() is Cause.SETPOINTS
    assert watch.pass_s(3.0, is_sending=False) is Cause.SETPOINTS


def test_setpoints_that_go_on_at_once_change_nothing_of_the_name() -> None:
    watch = Px4Watch()
    watch.pass_s(5.0, is_sending=True)
    watch.pass_s(0.36, is_sending=False)
    watch.pass_s(0.1, is_sending=True)
    watch.mode = POSCTL
    assert watch.pass_s(1.0, is_sending=True) is Cause.SETPOINTS


@pytest.mark.parametrize(
    ("trigger", "cause"),
    [
        ("check_gf_violation_max_hor_dist", Cause.FENCE),
        ("commander_rc_lost", Cause.RC),
        ("check_battery_critical", Cause.BATTERY),
        ("check_modes_offboard_no_local_position", Cause.POSITION),
        ("check_gnss_receiver_no_fix", Cause.POSITION),
    ],
)
@pytest.mark.parametrize("is_first", [True, False])
def test_another_cause_next_to_missing_setpoints_counts_more(trigger: str, cause: Cause, *, is_first: bool) -> None:
    """It is overridden only with force."""
    watch = Px4Watch()
    watch.pass_s(5.0, is_sending=True)
    watch.pass_s(0.5, is_sending=False)
    names = (trigger, "check_modes_offboard_signal")
    for name in names if is_first else names[::-1]:
        watch.event(name, IN_OFFBOARD if "offboard" in name else IN_ANY)
    watch.mode = RTL
    assert watch.pass_s(1.0, is_sending=False) is cause


HOLD_FOR = "commander_failsafe_enter_hold"


def for_cause(number: int) -> bytes:
    """Returns the content of a failsafe's event that holds at first: mode, action, delay and cause."""
    return struct.pack("<IBHB", OFFBOARD, 6, 5, number)


@pytest.mark.parametrize(
    ("told", "cause"),
    [
        ([("check_modes_local_pos", IN_ANY), ("check_battery_critical", IN_ANY)], Cause.POSITION),
        ([("check_battery_critical", IN_ANY), ("check_battery_emergency", IN_ANY)], Cause.BATTERY),
        ([("check_battery_critical", IN_ANY)], Cause.FAILSAFE),  # as for wind: nothing that is known says so
        ([("commander_rc_lost", b""), ("check_battery_critical", IN_ANY), (HOLD_FOR, for_cause(1))], Cause.RC),
        # PX4 flies the action of the battery again: it ends what overrides one with any new one, and tells the worst.
        ([("commander_rc_lost", b""), ("check_battery_critical", IN_ANY), (HOLD_FOR, for_cause(4))], Cause.BATTERY),
    ],
)
def test_a_battery_that_stays_critical_is_no_cause_of_a_later_failsafe_unless_px4_says_so(
    told: list[tuple[str, bytes]], cause: Cause
) -> None:
    """Each report of PX4's checks names it again. A failsafe before, for the battery, was overridden by force."""
    watch = Px4Watch()
    watch.pass_s(5.0, is_sending=True)
    watch.event("check_battery_critical", IN_ANY)
    watch.event(HOLD_FOR, for_cause(4))
    watch.mode = RTL
    assert watch.pass_s(1.0, is_sending=False) is Cause.BATTERY
    watch.mode = watch.intended = OFFBOARD
    watch.pass_s(10.0, is_sending=True)
    for name, arguments in told:
        watch.event(name, arguments)
    watch.mode = RTL
    assert watch.pass_s(1.0, is_sending=True) is cause


@pytest.mark.parametrize("is_heartbeat_first", [False, True])
@pytest.mark.parametrize(("is_explained", "cause"), [(False, Cause.BATTERY), (True, Cause.FAILSAFE)])
def test_a_failsafe_that_held_in_the_mode_that_was_requested_keeps_its_cause(
    cause: Cause, *, is_explained: bool, is_heartbeat_first: bool
) -> None:
    """PX4 holds for 5 s before it returns. Amid its own hold it was told as "failsafe" only."""
    watch = Px4Watch()
    watch.mode = watch.intended = POSCTL if is_explained else HOLD
    watch.pass_s(1.0, is_sending=False)
    watch.event("check_battery_critical", b"\xff\xff\xff\xff\x0b")
    if is_explained:  # the pilot has ended it, and another one follows
        watch.mode = HOLD
        assert watch.pass_s(2.0, is_sending=False) is Cause.BATTERY
        watch.mode = POSCTL
    watch.pass_s(5.0, is_sending=False)
    watch.mode = RTL
    if is_heartbeat_first:
        watch.causes.held_by(watch.autopilot.mode(RTL), watch.now_s, is_armed=True)
    assert watch.pass_s(1.0, is_sending=False) is cause


def test_a_flight_that_has_lasted_too_long_is_named() -> None:
    """COM_FLT_TIME_MAX was "failsafe" only, though `flight time limit` was among the failing checks."""
    watch = Px4Watch()
    watch.pass_s(5.0, is_sending=True)
    watch.event("check_flight_time_limit", IN_ANY)
    watch.mode = RTL
    assert watch.pass_s(1.0, is_sending=True) is Cause.FLIGHT_TIME


def test_a_battery_counts_as_new_in_each_flight() -> None:
    watch = Px4Watch()
    for _ in range(2):
        watch.mode = watch.intended = OFFBOARD
        watch.pass_s(5.0, is_sending=True)
        watch.event("check_battery_critical", IN_ANY)
        watch.mode = RTL
        assert watch.pass_s(1.0, is_sending=True) is Cause.BATTERY
        watch.tell(is_armed=False)


def test_a_sensor_that_fails_next_to_a_pause_keeps_it_a_failsafe_without_a_name() -> None:
    watch = Px4Watch()
    watch.causes.on_sensors(Sensor.BATTERY, Sensor.BATTERY, 0.0)
    watch.pass_s(5.0, is_sending=True)
    watch.pass_s(0.5, is_sending=False)
    watch.causes.on_sensors(Sensor.BATTERY, 0, watch.now_s)
    watch.mode = RTL
    assert watch.pass_s(1.0, is_sending=False) is Cause.FAILSAFE


def test_a_failsafe_without_a_pause_is_not_for_missing_setpoints() -> None:
    watch = Px4Watch()
    watch.pass_s(5.0, is_sending=True)
    watch.mode = RTL
    assert watch.pass_s(1.0, is_sending=True) is Cause.FAILSAFE


def test_the_check_of_the_stream_says_nothing_in_another_mode() -> None:
    """PX4 repeats it in each report while a pilot flies."""
    watch = Px4Watch()
    watch.mode = POSCTL
    watch.event("check_modes_offboard_signal", IN_OFFBOARD)
    assert not watch.causes._signs


def test_a_ground_stations_mode_beyond_a_breached_fence_is_not_the_fences() -> None:
    """PX4 reports the breach anew with each mode. As measured with 1.17, a heartbeat tells LAND first."""
    watch, land = Px4Watch(), 4 << 16 | 6 << 24
    watch.pass_s(5.0, is_sending=True)
    watch.event("check_gf_violation_max_hor_dist", IN_ANY)
    watch.mode = RTL
    assert watch.pass_s(1.0, is_sending=False) is Cause.FENCE
    watch.mode = watch.intended = POSCTL
    assert watch.pass_s(3.0, is_sending=False) is Cause.SAFETY_PILOT
    watch.event("check_gf_violation_max_hor_dist", IN_ANY)
    watch.mode, watch.names_intended_mode = land, False
    assert watch.tell() is Cause.OPEN
    watch.intended, watch.names_intended_mode = land, True
    assert watch.pass_s(1.0, is_sending=False) is Cause.GROUND_STATION


def test_a_failsafe_in_another_mode_than_ours_is_not_for_missing_setpoints() -> None:
    """A ground station's mission: nobody needs setpoints there."""
    watch, mission = Px4Watch(), 4 << 16 | 4 << 24
    watch.mode = watch.intended = mission
    watch.pass_s(5.0, is_sending=False)
    watch.mode = RTL
    assert watch.pass_s(1.0, is_sending=False) is Cause.FAILSAFE


def test_ardupilot_has_no_failsafe_for_missing_setpoints() -> None:
    watch = Px4Watch(1e9, ArduCopter(), names_intended_mode=False)
    watch.mode = 4
    watch.pass_s(5.0, is_sending=True)
    watch.pass_s(1.0, is_sending=False)
    watch.mode = 6
    watch.causes.on_system_status(SystemStatus.CRITICAL, watch.now_s)
    assert watch.pass_s(1.0, is_sending=False) is Cause.FAILSAFE


@pytest.mark.parametrize(
    ("mode", "failing", "cause"),
    [(POSCTL, 0, Cause.SETPOINTS), (POSCTL, Sensor.BATTERY, Cause.FAILSAFE), (RTL, 0, Cause.FAILSAFE)],
)
def test_a_px4_that_is_found_in_its_fallback_has_missed_setpoints(mode: int, failing: int, cause: Cause) -> None:
    """ROS 1 does not tell which mode it was asked for. Of its failsafes only that one leads to POSCTL."""
    watch = Px4Watch(names_intended_mode=False)
    watch.mode = mode
    watch.causes.on_sensors(Sensor.BATTERY, Sensor.BATTERY, 0.0)
    watch.causes.on_sensors(Sensor.BATTERY, Sensor.BATTERY & ~failing, 0.0)
    watch.causes.on_system_status(SystemStatus.CRITICAL, 0.0)
    assert watch.pass_s(2.0, is_sending=False) is cause


def test_the_longest_gap_between_setpoints() -> None:
    sent = SetpointMonitor()
    assert sent.longest_gap_s(0.0, 5.0) == float("inf")
    for time_s in (1.0, 1.5, 3.5, 3.6):
        sent.on_sent(time_s)
    assert sent.longest_gap_s(0.0, 4.0) == 2.0
    assert sent.longest_gap_s(3.0, 4.0) == 2.0  # it ended after 3 s
    assert sent.longest_gap_s(3.55, 4.0) == pytest.approx(0.4)


def test_a_battery_that_was_not_measured_yet_while_ardupilot_boots_is_no_failsafe() -> None:
    """SYS_STATUS may come before the first heartbeat, and of a boot before that tells of it."""
    watch = Px4Watch(autopilot=ArduCopter(), names_intended_mode=False)
    watch.causes.on_sensors(Sensor.BATTERY, 0, 0.0)
    assert watch.causes.failsafe(watch.now_s, is_armed=False) is None
    watch.causes.on_system_status(SystemStatus.BOOT, 0.0)
    watch.causes.on_sensors(Sensor.BATTERY, 0, 0.0)
    assert watch.causes.failsafe(watch.now_s, is_armed=False) is None
    watch.causes.on_system_status(SystemStatus.CRITICAL, 2.0)
    watch.causes.on_sensors(Sensor.BATTERY, 0, 2.0)
    assert watch.causes.failsafe(watch.now_s, is_armed=False) is Cause.BATTERY
