"""The simulated autopilots do what the recorded ones did: flown the same way, they say the same, in the same order.

Where one does something else than the recording, it is wrong.
"""

from __future__ import annotations

import math
import struct
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.simulators import ArduPilot, Autopilot, MemoryPort, Px4
from tests.simulators.autopilot import STEP_S
from tests.simulators.codec import AutopilotCodec
from tests.simulators.px4 import ALTCTL, LAND, OFFBOARD, POSCTL, RTL, TAKEOFF, Mode
from tests.ual_daemon.backends.mavlink.traces import load
from ual_daemon.backends.mavlink.wire.frames import split
from ual_daemon.backends.mavlink.wire.messages import Message

COMPANION = 191
PX4_ID, ARDUPILOT_ID = 7, 1
ARDUPILOT_GUIDED, ARDUPILOT_LAND = 4, 9
# Sent only at times (what was asked for, events), or by what the recorded flights happened to do. They looked for a
# camera, changed a parameter, or had a setpoint of a kind that the other flight had not.
NOT_STREAMED = {
    "ATTITUDE_TARGET",
    "AUTOPILOT_VERSION",
    "COMMAND_ACK",
    "COMMAND_LONG",
    "GPS_GLOBAL_ORIGIN",
    "PARAM_VALUE",
    "POSITION_TARGET_GLOBAL_INT",
    "STATUSTEXT",
    "UNKNOWN_410",
    "UNKNOWN_411",
}
CLOCK = 0.975
"""Speed of the recorded PX4's clock: its simulator did not keep up."""


@dataclass
class ReportedSample:
    """Reports of an autopilot: the count of each message, and its changes, by kind."""

    counts: Counter[str] = field(default_factory=Counter)
    changes: dict[str, list[tuple[float, object]]] = field(default_factory=dict)
    positions: list[tuple[float, float, float, float]] = field(default_factory=list)
    duration_s: float = 0.0

    def take(self, time_s: float, message: Message) -> None:
        kind = message.get_type()
        self.counts[kind] += 1
        self.duration_s = time_s
        if kind == "HEARTBEAT":
            self._change("heartbeat", time_s, (message.base_mode, message.custom_mode, message.system_status))
        elif kind == "CURRENT_MODE":
            self._change("mode", time_s, (message.custom_mode, message.intended_custom_mode))
        elif kind == "EXTENDED_SYS_STATE":
            self._change("landed", time_s, message.landed_state)
        elif kind == "GPS_RAW_INT":
            self._change("fix", time_s, message.fix_type)
        elif kind in ("ESTIMATOR_STATUS", "EKF_STATUS_REPORT"):
            good = mavlink.ESTIMATOR_POS_HORIZ_REL | mavlink.ESTIMATOR_VELOCITY_HORIZ
            self._change("position is good", time_s, message.flags & good == good)
        elif kind == "COMMAND_ACK":
            self.changes.setdefault("acks", []).append((time_s, (message.command, message.result)))
        elif kind == "STATUSTEXT":
            self.changes.setdefault("texts", []).append((time_s, message.text))
        elif kind == "LOCAL_POSITION_NED":
            self.positions.append((time_s, message.x, message.y, message.z))

    def values(self, kind: str) -> list[object]:
        return [value for _, value in self.changes.get(kind, [])]

    def times_s(self, kind: str) -> list[float]:
        return [time_s for time_s, _ in self.changes.get(kind, [])]

    def position(self, time_s: float) -> tuple[float, float, float]:
        """The last one before a time."""
        return [place[1:] for place in self.positions if place[0] <= time_s][-1]

    def _change(self, kind: str, time_s: float, value: object) -> None:
        changes = self.changes.setdefault(kind, [])
        if not changes or changes[-1][1] != value:
            changes.append((time_s, value))


def reported(frames: Iterable[tuple[float, bytes]], system_id: int) -> ReportedSample:
    codec, result = AutopilotCodec(COMPANION), ReportedSample()
    for time_s, data in frames:
        (frame,), _ = split(data)
        if (frame.system_id, frame.component_id) == (system_id, 1):
            result.take(time_s, codec.decode(frame))
    return result


class Flight:
    """A simulated autopilot and its companion, with time in the test's hand; 0 is when the recording begins."""

    def __init__(self, autopilot: Autopilot, port: MemoryPort, begin_s: float, clock: float = 1.0) -> None:
        self.autopilot = autopilot
        self._begin_s = begin_s
        self._clock = clock
        self._port = port
        self._codec = AutopilotCodec(COMPANION)
        self._codec.join(autopilot.system_id)
        self._setpoint: Callable[[], Message] | None = None
        self._next_s = 0.0

    @property
    def time_s(self) -> float:
        return (self.autopilot.now_s - self._begin_s) / self._clock

    def until(self, time_s: float) -> None:
        """Time passes; the companion streams its setpoint at 20 Hz."""
        while self.time_s < time_s - STEP_S / 2:
            if self._setpoint is not None and self.time_s >= self._next_s:
                self._next_s = self.time_s + 0.05
                self.send(self._setpoint())
            self.autopilot.step()

    def send(self, message: Message) -> None:
        self._port.arriving.append(self._codec.encode(message))

    def command(self, command: int, *params: float) -> None:
        padded = (*params, *(0.0,) * (7 - len(params)))
        self.send(mavlink.MAVLink_command_long_message(self.autopilot.system_id, 1, command, 0, *padded))

    def set_mode(self, main: int, sub: int = 0) -> None:
        self.command(mavlink.MAV_CMD_DO_SET_MODE, 1.0, float(main), float(sub))

    def set_interval(self, message_id: int, rate_hz: float) -> None:
        self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, float(message_id), 1e6 / rate_hz)

    def fly_to(self, north: float, east: float, down: float) -> None:
        self._fly(0b110111111000, (north, east, down), (0.0, 0.0, 0.0), 0.0)

    def fly(self, north: float, east: float, down: float, yaw_rate_rad_s: float = 0.0) -> None:
        self._fly(0b010111000111, (0.0, 0.0, 0.0), (north, east, down), yaw_rate_rad_s)

    def _fly(self, mask: int, position: tuple[float, ...], velocity: tuple[float, ...], yaw_rate_rad_s: float) -> None:
        self._setpoint = lambda: mavlink.MAVLink_set_position_target_local_ned_message(
            0, self.autopilot.system_id, 1, 1, mask, *position, *velocity, 0.0, 0.0, 0.0, 0.0, yaw_rate_rad_s
        )

    def stop_setpoints(self) -> None:
        self._setpoint = None

    def reported(self) -> ReportedSample:
        return reported(
            [((time_s - self._begin_s) / self._clock, data) for time_s, data in self._port.sent],
            self.autopilot.system_id,
        )


def assert_same(
    seen: ReportedSample, recorded: ReportedSample, kind: str, tolerance_s: float, *, later_s: float | None = None
) -> None:
    """The same changes in the same order, at about the same times (those after the flight's landing: `later_s`)."""
    assert seen.values(kind) == recorded.values(kind)
    for number, (seen_s, recorded_s) in enumerate(zip(seen.times_s(kind), recorded.times_s(kind), strict=True)):
        allowed_s = later_s if later_s is not None and number >= len(recorded.values(kind)) - 1 else tolerance_s
        assert seen_s == pytest.approx(recorded_s, abs=allowed_s), (kind, number, recorded.values(kind)[number])


def assert_same_rates(seen: ReportedSample, recorded: ReportedSample) -> None:
    assert set(recorded.counts) - NOT_STREAMED == set(seen.counts) - NOT_STREAMED
    for name in set(recorded.counts) - NOT_STREAMED:
        recorded_hz = recorded.counts[name] / recorded.duration_s
        assert seen.counts[name] / seen.duration_s == pytest.approx(recorded_hz, rel=0.08, abs=0.1), name


def px4_flight(first_heartbeat_s: float) -> tuple[Flight, Px4]:
    port = MemoryPort()
    autopilot = Px4(port, system_id=PX4_ID, boot_s=4.0)
    return Flight(autopilot, port, 4.0 - first_heartbeat_s * CLOCK, CLOCK), autopilot


def ask_px4(flight: Flight) -> None:
    """Sends the recorder's requests."""
    flight.set_interval(mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 10.0)
    flight.set_interval(mavlink.MAVLINK_MSG_ID_CURRENT_MODE, 10.0)
    for message_id in (
        mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
        mavlink.MAVLINK_MSG_ID_HOME_POSITION,
        mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
    ):
        flight.command(mavlink.MAV_CMD_REQUEST_MESSAGE, float(message_id))


def pilot_sets(autopilot: Px4, mode: Mode) -> None:
    autopilot.pilot_moves(autopilot.sticks)
    assert autopilot.request_mode(mode)


def test_px4_takes_off_loiters_and_returns_as_recorded() -> None:
    trace = load("px4_auto_takeoff_loiter_rtl")
    at, recorded = trace.time_s, reported(trace.frames, PX4_ID)
    flight, autopilot = px4_flight(0.14)
    autopilot.parameters["MIS_TAKEOFF_ALT"] = 5.0
    autopilot.arm_refusal = "system health"
    flight.until(1.15)
    autopilot.arm_refusal = ""
    ask_px4(flight)
    flight.until(at("pilot_sets_mode"))
    pilot_sets(autopilot, TAKEOFF)
    flight.until(at("pilot_arms"))
    assert autopilot.pilot_arm()
    flight.until(at("pilot_sets_mode", 1))
    pilot_sets(autopilot, RTL)
    flight.until(recorded.duration_s)
    seen = flight.reported()
    assert_same_rates(seen, recorded)
    assert seen.values("acks") == recorded.values("acks")
    assert_same(seen, recorded, "landed", 1.5, later_s=2.5)
    assert_same(seen, recorded, "mode", 1.5, later_s=2.5)
    assert_same(seen, recorded, "heartbeat", 2.0, later_s=3.0)
    lift_off_s = at("truth_lift_off")
    assert seen.position(lift_off_s - 1.5)[2] == pytest.approx(-0.37, abs=0.01)
    assert seen.position(lift_off_s + 0.5)[2] < -0.5
    climbed_m = -0.37 - seen.position(at("pilot_sets_mode", 1))[2]
    assert climbed_m == pytest.approx(5.0, abs=0.3)


def test_px4_is_executed_offboard_taken_by_the_pilot_and_recovered_as_recorded() -> None:
    trace = load("px4_offboard_manual_recover")
    at, recorded = trace.time_s, reported(trace.frames, PX4_ID)
    flight, autopilot = px4_flight(0.08)
    flight.until(0.09)
    ask_px4(flight)
    flight.until(2.13)
    pilot_sets(autopilot, POSCTL)  # the recorder did not note it
    flight.until(at("companion_requests_offboard") - 0.5)
    flight.fly_to(0.0, 0.0, -0.37)
    flight.until(at("companion_requests_offboard"))
    flight.set_mode(OFFBOARD.main)
    flight.until(at("pilot_arms"))
    assert autopilot.pilot_arm()
    flight.until(at("companion_begins_takeoff"))
    flight.fly_to(0.0, 0.0, -3.37)
    flight.until(at("companion_ends_takeoff"))
    flight.fly_to(5.0, 0.0, -3.37)
    flight.until(at("companion_velocity"))
    flight.fly(0.0, 1.0, -0.1, 0.3)  # it climbed, by its own estimate
    flight.until(at("pilot_sets_mode"))
    pilot_sets(autopilot, POSCTL)
    flight.stop_setpoints()
    for number, mode in enumerate((None, ALTCTL)):
        if mode is not None:
            flight.until(at("pilot_sets_mode", number))
            pilot_sets(autopilot, mode)
            flight.stop_setpoints()
        flight.until(at("companion_recovers_from_manual", number) - 0.4)
        flight.fly_to(*autopilot.position)
        flight.until(at("companion_recovers_from_manual", number))
        flight.set_mode(OFFBOARD.main)
    flight.until(at("companion_begins_landing"))
    flight.set_mode(LAND.main, LAND.sub)
    flight.until(at("companion_begins_landing") + 0.2)
    flight.stop_setpoints()
    flight.until(recorded.duration_s)
    seen = flight.reported()
    assert_same_rates(seen, recorded)
    assert seen.values("acks") == recorded.values("acks")
    assert_same(seen, recorded, "landed", 0.5, later_s=2.5)
    assert_same(seen, recorded, "mode", 0.3, later_s=2.5)
    assert_same(seen, recorded, "heartbeat", 1.1, later_s=2.5)
    waypoint = seen.position(at("at_waypoint"))
    assert math.dist(waypoint, (5.0, 0.0, -3.37)) < 0.7


def test_px4_loses_gps_offboard_as_recorded() -> None:
    trace = load("px4_gps_loss_in_offboard")
    at, recorded = trace.time_s, reported(trace.frames, PX4_ID)
    flight, autopilot = px4_flight(0.24)
    autopilot.pilot_moves(autopilot.sticks)
    flight.until(0.25)
    ask_px4(flight)
    flight.until(at("companion_requests_offboard") - 0.5)
    flight.fly_to(0.0, 0.0, -0.37)
    flight.until(at("companion_requests_offboard"))
    flight.set_mode(OFFBOARD.main)
    flight.until(at("pilot_arms"))
    assert autopilot.pilot_arm()
    flight.until(at("companion_begins_takeoff"))
    flight.fly_to(0.0, 0.0, -3.37)
    flight.until(at("gps_lost"))
    autopilot.lose_gps()
    flight.until(recorded.duration_s)
    seen = flight.reported()
    assert_same_rates(seen, recorded)
    assert seen.values("acks") == recorded.values("acks")
    assert_same(seen, recorded, "landed", 0.5, later_s=4.0)
    assert_same(seen, recorded, "mode", 0.5, later_s=4.0)
    assert_same(seen, recorded, "heartbeat", 1.2, later_s=4.0)
    assert_same(seen, recorded, "fix", 0.3)
    assert_same(seen, recorded, "position is good", 1.2)


def test_ardupilot_is_executed_guided_taken_by_the_pilot_and_recovered_as_recorded() -> None:
    trace = load("ardupilot_guided_manual_recover")
    at, recorded = trace.time_s, reported(trace.frames, ARDUPILOT_ID)
    port, radio = MemoryPort(), MemoryPort()
    autopilot = ArduPilot(port, radio, boot_s=42.3, start=(0.0, 0.0, 0.01))
    autopilot.parameters["FLTMODE4"] = 3  # AUTO
    flight = Flight(autopilot, port, 42.3)
    sticks = [1500, 1500, 1000, 1500, 1500, 1500, 1500, 1500]

    def fly_until(time_s: float) -> None:
        """The pilot's transmitter says how its sticks are 40 times a second."""
        while flight.time_s < time_s - STEP_S / 2:
            radio.arriving.append(struct.pack("<8H", *sticks))
            flight.until(min(time_s, flight.time_s + 0.025))

    for message_id, rate_hz in (
        (mavlink.MAVLINK_MSG_ID_ATTITUDE, 30.0),
        (mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, 30.0),
        (mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, 30.0),
        (mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 10.0),
        (mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 10.0),
        (mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT, 5.0),
        (mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, 5.0),
        (mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED, 5.0),
        (mavlink.MAVLINK_MSG_ID_SYS_STATUS, 2.0),
        (mavlink.MAVLINK_MSG_ID_HOME_POSITION, 1.0),
        (mavlink.MAVLINK_MSG_ID_BATTERY_STATUS, 1.0),
    ):
        flight.set_interval(message_id, rate_hz)
    fly_until(at("companion_sets_guided"))
    flight.set_mode(ARDUPILOT_GUIDED)
    fly_until(at("pilot_arms"))
    flight.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    fly_until(at("companion_begins_takeoff"))
    flight.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0)
    sticks[2] = 1500
    fly_until(at("companion_velocity"))
    flight.fly(1.0, 0.0, 0.0)
    fly_until(at("companion_velocity") + 1.0)  # and then no more: GUID_TIMEOUT
    flight.stop_setpoints()
    fly_until(at("pilot_switches_to_loiter"))
    sticks[4] = 1700
    fly_until(19.6)
    sticks[1] = 1300
    fly_until(22.0)
    sticks[1] = 1500
    fly_until(23.6)
    sticks[4] = 1500
    fly_until(at("companion_recovers_from_manual"))
    flight.set_mode(ARDUPILOT_GUIDED)
    fly_until(at("companion_begins_landing"))
    flight.set_mode(ARDUPILOT_LAND)
    sticks[2] = 1000
    fly_until(recorded.duration_s)
    seen = flight.reported()
    assert_same_rates(seen, recorded)
    assert seen.values("acks") == recorded.values("acks")
    assert_same(seen, recorded, "heartbeat", 1.1)
    assert_same(seen, recorded, "landed", 0.6, later_s=1.0)
    assert_same(seen, recorded, "fix", 0.3)
    said = {"Arming motors", "Disarming motors", "Mode change to AUTO failed: init failed"}
    assert [text for text in recorded.values("texts") if text in said] == seen.values("texts")
    assert seen.counts["GPS_GLOBAL_ORIGIN"] == 1  # pushed at arming; the recorder asked for the other one
    for time_s in (6.0, 8.0, 10.0, 13.0, 15.0, 18.0, 30.0, 32.0):
        assert math.dist(seen.position(time_s), recorded.position(time_s)) < 0.6 or time_s > 18.0
        assert seen.position(time_s)[2] == pytest.approx(recorded.position(time_s)[2], abs=0.4)
