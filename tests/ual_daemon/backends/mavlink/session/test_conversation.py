import itertools
import math
from typing import Any

import pytest

from tests.ual_daemon.backends.mavlink.fakes import (
    ADDRESS,
    BOOT_MS,
    UTC_S,
    Talk,
    ack,
    attitude,
    heartbeat,
    packer,
    position,
)
from ual.geometry import Vector3
from ual.types import GpsFix, State
from ual_daemon.backends.mavlink.backend import MavlinkBackend
from ual_daemon.backends.mavlink.settings import MavlinkSettings
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.values import Control, LandedState
from ual_daemon.flight.state import estimate
from ual_daemon.geodesy import SphereProjection

GOOD = 0x37F


def estimator_status(flags: int = GOOD) -> Message:
    return mavlink.MAVLink_estimator_status_message(0, flags, 0, 0, 0, 0, 0, 0, 0, 0)


def on_ground() -> Message:
    return mavlink.MAVLink_extended_sys_state_message(0, mavlink.MAV_LANDED_STATE_ON_GROUND)


def state(talk: Talk) -> State:
    return estimate(talk.snapshot(), MavlinkBackend.freshness).state


# --- Whom it hears ----------------------------------------------------------------------------------------------------


def test_the_first_autopilot_heard_is_the_only_one() -> None:
    talk = Talk()
    talk.hear(data=packer(7)(heartbeat()))
    talk.hear(data=packer(8)(heartbeat(armed=True)))
    talk.hear(data=packer(8)(attitude()) + packer(8)(position(0.0)))
    assert talk.vehicle.system_id == 7
    assert talk.snapshot().armed.value is False
    assert talk.snapshot().pose is None


def test_with_a_system_id_set_any_other_is_passed_over() -> None:
    talk = Talk(MavlinkSettings(system_id=8))
    talk.hear(data=packer(7)(heartbeat()))
    assert talk.conversation.vehicle is None
    talk.hear(data=packer(8)(heartbeat()))
    assert talk.vehicle.system_id == 8


def test_heartbeats_of_other_components_change_nothing() -> None:
    talk = Talk()
    gcs = heartbeat(autopilot=mavlink.MAV_AUTOPILOT_INVALID, kind=mavlink.MAV_TYPE_GCS)
    talk.hear(data=packer(255, 190)(gcs))
    talk.hear(data=packer(9, 1)(gcs))  # some ground stations call themselves component 1
    assert talk.conversation.vehicle is None
    talk.hear(heartbeat(0x00060000, armed=True))
    talk.hear(data=packer(1, 154)(heartbeat(0)))  # a gimbal of the same system
    talk.hear(data=packer(255, 190)(gcs))
    snapshot = talk.snapshot()
    assert (snapshot.armed.value, snapshot.mode.value.name) == (True, "OFFBOARD")


def test_nothing_is_sent_until_somebody_is_known_and_then_to_where_he_sends_from() -> None:
    talk = Talk()
    talk.run(3.0)
    assert talk.link.sent == []
    talk.hear(heartbeat(), address=("10.0.0.7", 1234))
    assert talk.link.peer == ("10.0.0.7", 1234)
    talk.hear(attitude(), address=("10.0.0.7", 5678))
    assert talk.link.peer == ("10.0.0.7", 5678)


def test_who_sends_no_valid_frame_is_not_answered() -> None:
    talk = Talk()
    talk.hear(heartbeat())
    damaged = bytearray(talk.pack(attitude()))
    damaged[-1] ^= 1
    talk.hear(data=bytes(damaged), address=("6.6.6.6", 6))
    talk.hear(data=packer(2)(attitude()), address=("6.6.6.6", 6))
    assert talk.link.peer == ADDRESS


def test_a_known_peer_is_called_once_a_second_until_the_autopilot_answers() -> None:
    talk = Talk()
    talk.link.answer_to(ADDRESS)
    talk.run(2.5)
    assert len(talk.link.take("HEARTBEAT")) == 3


def test_our_heartbeat_is_an_onboard_computers_of_the_same_system_at_1_hz() -> None:
    talk = Talk()
    talk.hear(data=packer(7)(heartbeat()))
    talk.run(5.0)
    beats = talk.link.take("HEARTBEAT")
    assert len(beats) == 5
    assert {(b.get_srcSystem(), b.get_srcComponent(), b.type, b.autopilot) for b in beats} == {
        (7, 191, mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID)
    }


# --- What it makes of it ----------------------------------------------------------------------------------------------


def test_pose_and_velocity_are_in_our_axes() -> None:
    talk = Talk()
    talk.hear(heartbeat(), attitude(0.0), position(0.0, north=1.0, east=2.0, down=-3.0))
    snapshot = talk.snapshot()
    assert snapshot.pose.value.position == Vector3(2.0, 1.0, 3.0)
    assert snapshot.pose.value.yaw_rad == pytest.approx(math.pi / 2)
    assert snapshot.velocity.value.linear == Vector3(0.25, 0.5, 0.125)
    assert tuple(snapshot.velocity.value.angular) == pytest.approx((0.1, -0.2, -0.3))


def test_a_position_without_a_fresh_attitude_is_no_pose() -> None:
    talk = Talk()
    talk.hear(heartbeat(), position(0.0))
    assert talk.snapshot().pose is None
    talk.hear(attitude(), position(0.0))
    assert talk.snapshot().pose.time_s == 0.0
    talk.now_s = 0.6
    talk.hear(position(0.6))
    assert talk.snapshot().pose.time_s == 0.0


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_position_that_is_no_number_is_no_pose(bad: float) -> None:
    talk = Talk()
    talk.hear(heartbeat(), attitude(), position(0.0, north=bad))
    assert talk.snapshot().pose is None


def test_the_stamp_is_when_the_autopilot_measured() -> None:
    talk = Talk()
    talk.hear(heartbeat(), attitude(), position(0.0))
    talk.now_s = 0.3  # comes 0.1 s late
    talk.hear(attitude(), position(0.2))
    assert talk.snapshot().stamp_s == pytest.approx(UTC_S + 0.2)


def test_a_pose_that_is_not_renewed_keeps_its_stamp() -> None:
    talk = Talk()
    talk.hear(heartbeat(), attitude(), position(0.0))
    talk.now_s = 1.0
    talk.hear(position(1.0))  # without an attitude it is no pose
    assert talk.snapshot().pose.time_s == 0.0
    assert talk.snapshot().stamp_s == pytest.approx(UTC_S)


def test_an_autopilot_that_says_everything_is_ready() -> None:
    talk = Talk()
    talk.hear(heartbeat())
    assert state(talk) is State.UNINITIALIZED
    talk.hear(attitude(), position(0.0), on_ground(), estimator_status())
    assert state(talk) is State.LANDED_DISARMED


def test_before_px4_says_whether_it_is_landed_it_is_not_taken_for_flying() -> None:
    talk = Talk()
    talk.hear(heartbeat(armed=True), attitude(), position(0.0), estimator_status())
    found = estimate(talk.snapshot(), MavlinkBackend.freshness)
    assert (found.state, found.why) == (State.UNINITIALIZED, "the autopilot has not said whether it is landed")


def test_silence_is_told_as_a_lost_link_and_not_as_a_lost_value() -> None:
    talk = Talk()
    talk.hear(heartbeat(), attitude(), position(0.0), on_ground(), estimator_status())
    talk.now_s = 0.02
    talk.hear(mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0))
    found = []
    for _ in range(200):
        talk.now_s += 0.01
        found.append(estimate(talk.snapshot(), MavlinkBackend.freshness))
    lost = [each for each in found if each.state is State.UNINITIALIZED]
    assert len(lost) > 50
    assert not any(each.is_link_up for each in lost)


def test_after_a_pause_of_ours_the_past_is_forgotten_and_asked_for_at_once() -> None:
    talk = Talk()
    talk.hear(
        heartbeat(armed=True), attitude(), position(0.0), on_ground(), estimator_status(),
        mavlink.MAVLink_gps_global_origin_message(1, 1, 1),
    )  # fmt: skip
    talk.run(0.5)
    assert state(talk) is State.LANDED_ARMED
    talk.link.sent.clear()
    talk.conversation.forget()
    assert state(talk) is State.UNINITIALIZED
    assert talk.snapshot().projection is not None
    talk.run(0.05)
    assert 0.0 in {sent.param1 for sent in talk.commands(REQUEST)}


def test_after_a_lost_link_the_past_is_forgotten_whatever_comes_first() -> None:
    for first in (position(1.3), attitude(), mavlink.MAVLink_ping_message(0, 0, 0, 0)):
        talk = Talk()
        flying = mavlink.MAVLink_extended_sys_state_message(0, mavlink.MAV_LANDED_STATE_IN_AIR)
        talk.hear(heartbeat(6 << 16, armed=True), attitude(), position(0.0), flying, estimator_status())
        assert state(talk) is State.FLYING_AUTO
        talk.run(1.3)  # what it does by itself meanwhile we do not hear
        talk.link.sent.clear()
        talk.hear(first)
        talk.hear(attitude(), position(1.3), estimator_status())
        assert state(talk) is State.UNINITIALIZED
        talk.run(0.1)
        assert 0.0 in {sent.param1 for sent in talk.commands(REQUEST)}
        talk.hear(heartbeat(4 << 16 | 5 << 24, armed=True), flying)
        assert state(talk) is State.FLYING_MANUAL


def test_a_message_that_makes_us_fail_costs_no_other(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    talk = Talk()
    talk.hear(heartbeat())
    update = talk.vehicle.update

    def failing(message: Message, now_s: float, utc_now_s: float) -> None:
        if message.get_type() == "ATTITUDE_QUATERNION":
            raise ZeroDivisionError
        update(message, now_s, utc_now_s)

    monkeypatch.setattr(talk.vehicle, "update", failing)
    talk.hear(data=talk.pack(attitude()) + talk.pack(heartbeat(armed=True)))
    talk.hear(attitude())
    assert talk.snapshot().armed.value is True
    (told,) = [record for record in caplog.records if "could not be used" in record.message]
    assert "message 31 " in told.message


@pytest.mark.parametrize(
    "kind", [mavlink.MAV_TYPE_FIXED_WING, mavlink.MAV_TYPE_GROUND_ROVER, mavlink.MAV_TYPE_VTOL_TILTROTOR]
)
def test_a_px4_that_is_no_multirotor_is_only_watched(kind: int) -> None:
    talk = Talk()
    talk.hear(heartbeat(kind=kind), attitude(), position(0.0))
    assert talk.snapshot().pose is not None
    info = talk.vehicle.info()
    assert not info.capabilities
    assert info.autopilot.startswith("unknown (px4, ")


def _place(latitude: int, longitude: int) -> Message:
    return mavlink.MAVLink_global_position_int_message(BOOT_MS, latitude, longitude, 488_000, 3_000, 0, 0, 0, 0)


def test_a_place_on_earth_is_told_while_it_is_fresh_and_one() -> None:
    talk = Talk()
    talk.hear(heartbeat(), _place(0, 0))  # ArduPilot before its first fix
    assert talk.snapshot().position_geo is None
    talk.hear(_place(473977420, 85455940))
    assert talk.snapshot().position_geo.latitude_deg == pytest.approx(47.397742)
    talk.now_s += 1.0
    talk.hear(heartbeat())
    assert talk.snapshot().position_geo is not None
    talk.now_s += 1.0
    talk.hear(heartbeat())
    assert talk.snapshot().position_geo is None


@pytest.mark.parametrize(
    ("flags", "why"),
    [
        (0x3FF, ""),
        (0x33F, ""),
        (0x37F, ""),
        (0x365, "no horizontal velocity, horizontal position"),
        (0x25, "no horizontal velocity, horizontal position"),
        (0, "no attitude, horizontal velocity, vertical velocity, horizontal position, height"),
    ],
)
def test_the_estimator_is_good_by_its_flags(flags: int, why: str) -> None:
    talk = Talk()
    talk.hear(heartbeat(), estimator_status(flags))
    estimator = talk.snapshot().estimator.value
    assert (estimator.is_good, estimator.why) == (not why, why)


def test_a_mode_is_taken_from_whichever_message_says_it_first() -> None:
    talk = Talk()
    talk.hear(heartbeat(0x00060000))
    assert talk.snapshot().mode.value.control is Control.REFERENCES
    talk.hear(mavlink.MAVLink_current_mode_message(0, 0x00030000, 0))
    assert talk.snapshot().mode.value.name == "POSCTL"


def test_battery_gps_and_places_are_told_in_our_units() -> None:
    talk = Talk()
    talk.hear(
        heartbeat(),
        mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 16200, 1234, 87, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_gps_raw_int_message(
            0, 6, 473977000, 85455000, 489000, 70, 110, 3, 0, 14, 536500, 25, 40, 400, 0
        ),
        mavlink.MAVLink_global_position_int_message(0, 473977427, 85455967, 492000, 3000, 0, 0, 0, 0),
        mavlink.MAVLink_gps_global_origin_message(473977428, 85455967, 489052),
        mavlink.MAVLink_home_position_message(
            473977427, 85455967, 489454, 0.0, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0
        ),
    )
    snapshot = talk.snapshot()
    battery, gps, geo = snapshot.battery, snapshot.gps, snapshot.position_geo
    assert (battery.voltage_v, battery.current_a, battery.remaining_percent) == (16.2, 12.34, 87.0)
    assert (gps.fix, gps.satellites_count) == (GpsFix.RTK_FIXED, 14)
    assert (gps.horizontal_accuracy_m, gps.vertical_accuracy_m) == (0.025, 0.04)
    assert snapshot.geoid_separation_m == pytest.approx(47.5)
    assert (geo.latitude_deg, geo.longitude_deg) == pytest.approx((47.3977427, 8.5455967))
    assert (geo.altitude_amsl_m, geo.altitude_home_m) == (492.0, 3.0)
    assert geo.altitude_ellipsoid_m == pytest.approx(539.5)
    assert snapshot.home_altitude_amsl_m == 489.454
    assert isinstance(snapshot.projection, SphereProjection)
    assert snapshot.projection.altitude_amsl_m == 489.052


def test_what_is_not_known_is_none() -> None:
    talk = Talk()
    talk.hear(heartbeat(), mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 0xFFFF, -100, -1, 0, 0, 0, 0, 0, 0))
    assert talk.snapshot().battery is None
    talk.hear(mavlink.MAVLink_gps_raw_int_message(0, 1, 0, 0, 0, 0, 0, 0, 0, 255))
    gps = talk.snapshot().gps
    assert (gps.fix, gps.satellites_count, gps.horizontal_accuracy_m) == (GpsFix.NONE, 0, None)
    assert talk.snapshot().geoid_separation_m is None


def test_a_long_status_text_is_put_together() -> None:
    talk = Talk()
    talk.hear(heartbeat(), mavlink.MAVLink_statustext_message(6, b"a" * 50, 3, 0))
    talk.hear(mavlink.MAVLink_statustext_message(6, b"bc", 3, 1))
    assert talk.snapshot().status_text == "a" * 50 + "bc"
    talk.hear(mavlink.MAVLink_statustext_message(6, b"new", 4, 0))
    assert talk.snapshot().status_text == "new"


def _heard_out_of_order(talk: Talk, earlier: Any, later: Any) -> None:
    first, second = talk.pack(earlier), talk.pack(later)
    talk.hear(data=second)
    talk.now_s += 0.1
    talk.hear(data=first)


def test_a_message_that_comes_late_does_not_bring_the_past_back() -> None:
    talk = Talk()
    offboard, landing = 6 << 16, 4 << 16 | 6 << 24
    talk.hear(heartbeat(offboard, armed=True))
    _heard_out_of_order(talk, heartbeat(offboard, armed=True), heartbeat(landing, armed=False))
    assert talk.snapshot().mode.value.name == "AUTO.LAND"
    assert talk.snapshot().armed.value is False
    mode = mavlink.MAVLink_current_mode_message
    _heard_out_of_order(talk, mode(0, landing, 0), heartbeat(offboard, armed=True))  # whichever message told it
    assert talk.snapshot().mode.value.name == "OFFBOARD"
    said = mavlink.MAVLink_extended_sys_state_message
    _heard_out_of_order(talk, said(0, mavlink.MAV_LANDED_STATE_IN_AIR), said(0, mavlink.MAV_LANDED_STATE_ON_GROUND))
    assert talk.snapshot().landed.value is LandedState.ON_GROUND
    talk.hear(attitude())
    _heard_out_of_order(talk, position(1.0, north=1.0), position(1.02, north=2.0))
    assert talk.snapshot().pose.value.position.y == 2.0


def test_a_copy_of_the_mode_before_is_known_by_its_number_however_long_it_was_on_its_way() -> None:
    talk = Talk()
    offboard, position_mode = 6 << 16, 3 << 16
    copy = talk.pack(mavlink.MAVLink_current_mode_message(0, offboard, 0))
    talk.hear(data=copy)
    talk.hear(heartbeat(position_mode, armed=True))
    for _ in range(30):
        talk.now_s += 0.05
        talk.hear(attitude())
    talk.hear(data=copy)
    assert talk.snapshot().mode.value.name == "POSCTL"


def test_numbers_that_begin_anew_are_believed_after_a_moment() -> None:
    talk = Talk()
    for _ in range(5):
        talk.hear(heartbeat(armed=True))
    talk.pack = packer()  # another boot, say
    talk.run(0.35)
    talk.hear(heartbeat(armed=False))
    assert talk.snapshot().armed.value is False


def test_a_landed_state_that_is_not_known_is_unknown() -> None:
    talk = Talk()
    talk.hear(heartbeat(), mavlink.MAVLink_extended_sys_state_message(0, 77))
    assert talk.snapshot().landed.value is LandedState.UNKNOWN


# --- What it asks -----------------------------------------------------------------------------------------------------

INTERVAL, REQUEST = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE
STREAMS = {436: 50_000.0, 245: 50_000.0, 230: 100_000.0, 31: 20_000.0, 32: 20_000.0}


def _asked_streams(talk: Talk, *, until_s: float) -> dict[int, float]:
    """What it asks to be streamed while every request is accepted."""
    asked: dict[int, float] = {}
    while talk.now_s < until_s:
        talk.run(0.05)
        for sent in talk.commands(INTERVAL):
            asked[int(sent.param1)] = sent.param2
            talk.hear(ack(INTERVAL, mavlink.MAV_RESULT_ACCEPTED))
    return asked


def _turned(now_s: float) -> Any:
    message = attitude()
    message.time_boot_ms += int(now_s * 1000)
    return message


def _stream(talk: Talk, *, until_s: float, without: int = 0) -> set[float]:
    """It sends what it was asked for, a third of it at that: the link is bad. What it is asked meanwhile."""
    asked: set[float] = set()
    while talk.now_s < until_s:
        talk.run(0.15)
        said = [
            mavlink.MAVLink_current_mode_message(0, 0x03040000, 0),
            mavlink.MAVLink_extended_sys_state_message(0, 1),
            mavlink.MAVLink_estimator_status_message(0, 0x37F, *[0.0] * 8),
            *[_turned(talk.now_s), position(talk.now_s)] * 3,
        ]
        for sent in talk.commands(INTERVAL):
            asked.add(sent.param1)
            said.append(ack(INTERVAL, mavlink.MAV_RESULT_ACCEPTED))
        talk.hear(*[message for message in said if message.get_msgId() != without])
    return asked


def test_streams_are_asked_for_until_each_is_acknowledged_and_flows() -> None:
    talk = Talk()
    talk.hear(heartbeat())
    talk.run(30.0)  # nobody answers
    talk.link.sent.clear()
    assert _asked_streams(talk, until_s=45.0) == STREAMS
    _stream(talk, until_s=60.0)
    assert _stream(talk, until_s=90.0) == set()


def test_a_stream_that_does_not_flow_is_asked_for_again_though_it_was_acknowledged() -> None:
    talk = Talk()
    talk.hear(heartbeat())
    assert _asked_streams(talk, until_s=2.0) == STREAMS  # by the acknowledgement of another, for all we know
    _stream(talk, until_s=4.0, without=245)
    assert _stream(talk, until_s=6.0, without=245) == {245.0}


def test_a_stream_that_it_refuses_is_not_asked_for_again() -> None:
    talk = Talk()
    talk.hear(heartbeat())
    asked_count = 0
    for _ in range(400):
        talk.run(0.05)
        for _ in talk.commands(INTERVAL):
            asked_count += 1
            talk.hear(ack(INTERVAL, mavlink.MAV_RESULT_UNSUPPORTED))
    assert asked_count == len(STREAMS)


def test_what_is_sent_only_on_request_is_requested_until_it_comes() -> None:
    talk = Talk()
    talk.hear(heartbeat())
    talk.run(20.0)
    assert {sent.param1 for sent in talk.commands(REQUEST)} == {148.0, 49.0, 242.0}
    talk.hear(mavlink.MAVLink_home_position_message(1, 1, 1, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0))
    talk.run(5.0)  # those that were under way
    talk.link.sent.clear()
    talk.run(60.0)
    assert {sent.param1 for sent in talk.commands(REQUEST)} == {148.0, 49.0}


def test_px4s_origin_is_asked_for_now_and_then_as_the_message_that_moves_it_may_have_been_lost() -> None:
    talk = Talk()
    talk.hear(heartbeat())
    talk.hear(mavlink.MAVLink_gps_global_origin_message(1, 1, 1))
    talk.run(20.0)
    talk.link.sent.clear()
    talk.run(60.0)
    assert 5 <= [sent.param1 for sent in talk.commands(REQUEST)].count(49.0) <= 6 * 4  # each is sent four times at most


def test_limits_come_from_parameters_that_are_read_until_they_are_known() -> None:
    talk = Talk()
    talk.hear(heartbeat())
    talk.run(0.1)
    asked = {message.param_id for message in talk.link.take("PARAM_REQUEST_READ")}
    assert "MPC_XY_VEL_MAX" in asked
    talk.hear(mavlink.MAVLink_param_value_message(b"MPC_XY_VEL_MAX", 12.0, 9, 900, 1))
    talk.hear(mavlink.MAVLink_param_value_message(b"MPC_YAWRAUTO_MAX", 90.0, 9, 900, 1))
    talk.run(1.0)
    again = {message.param_id for message in talk.link.take("PARAM_REQUEST_READ")}
    assert again == asked - {"MPC_XY_VEL_MAX", "MPC_YAWRAUTO_MAX"}
    limits = talk.vehicle.info().limits
    assert limits.horizontal_speed_m_s == 12.0
    assert limits.yaw_rate_rad_s == pytest.approx(math.pi / 2)


def test_a_parameter_that_it_does_not_have_is_asked_for_ever_more_rarely() -> None:
    talk = Talk()
    talk.hear(heartbeat())
    asked_s: list[float] = []
    while talk.now_s < 3600.0:
        talk.run(0.5, 0.5)
        asked = [message.param_id for message in talk.link.take("PARAM_REQUEST_READ")]
        asked_s += [talk.now_s] * asked.count("MPC_XY_VEL_MAX")
    assert 8 <= len(asked_s) <= 17
    pauses_s = [later - earlier for earlier, later in itertools.pairwise(asked_s)]
    assert pauses_s == sorted(pauses_s)
    assert pauses_s[-1] > 600.0


def test_after_a_reboot_everything_is_asked_anew_and_the_old_boots_places_are_forgotten() -> None:
    talk = Talk()
    talk.hear(heartbeat(), attitude(), position(100.0), mavlink.MAVLink_gps_global_origin_message(1, 1, 1))
    assert _asked_streams(talk, until_s=10.0) == STREAMS
    talk.hear(
        mavlink.MAVLink_attitude_quaternion_message(BOOT_MS // 10, 1, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_local_position_ned_message(BOOT_MS // 10, 0, 0, 0, 0, 0, 0),
    )
    assert talk.snapshot().projection is None
    assert talk.snapshot().stamp_s == pytest.approx(UTC_S + talk.now_s)
    assert talk.supervision.reboots_count == 1
    assert _asked_streams(talk, until_s=20.0) == STREAMS


def test_after_a_silence_everything_is_asked_anew() -> None:
    talk = Talk()
    talk.hear(heartbeat())
    assert _asked_streams(talk, until_s=2.0) == STREAMS
    talk.run(10.0)
    talk.hear(heartbeat())
    assert _asked_streams(talk, until_s=20.0) == STREAMS
