"""PX4's events (its libevents interface), which it sends on every link at once, ground station or not.

An event is identified by the hash of its name (PX4's ``events::ID``). PX4's own sentences are in a file on the vehicle;
the names say as much, so the names are reported. Those below are of PX4 1.17 and 1.18, and concern arming and its
refusal.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from ual_daemon.backends.values import Cause

AUTOPILOT_ID = 1 << 24
"""The part of an event's id that says that it is of the autopilot, and not of another component."""
_WARNING_LEVEL = 4
"""An external log level (the lower four bits): this one and lower ones are warnings, errors and worse."""

_DENIALS = """
commander_arm_denied_calibrating commander_arm_denied_throttle_center commander_arm_denied_throttle_high
commander_arm_denied_not_manual commander_arm_denied_resolve_failures commander_disarm_denied_not_landed
commander_modeswitch_not_avail commander_unsupported_auto_mode
commander_arm_denied_throttle_unsafe commander_unsupported_base_mode commander_unsupported_main_mode
"""
_CHECKS = """
above_wind_limits_warning accel_missing accel_no_data accel_not_calibrated airspeed_invalid airspeed_no_data
airspeed_too_high armable_configuration avionics_power_high avionics_power_low avionics_power_missing
avionics_power_redundancy baro_missing baro_no_data battery_critical battery_disconnected battery_emergency
battery_fault battery_low battery_missing battery_rem_flight_time_low battery_unhealthy cpuload_too_high
distance_sensor_invalid distance_sensor_missing escs_fault escs_offline escs_telem_missing estimator_gnss_fault
estimator_gps_fix_too_low estimator_gps_generic estimator_gps_hor_pos_drift_too_high
estimator_gps_hor_pos_err_too_high estimator_gps_hor_speed_drift_too_high estimator_gps_jamming_critical
estimator_gps_not_fusing estimator_gps_num_sats_too_low estimator_gps_pdop_too_high estimator_gps_speed_acc_too_low
estimator_gps_spoofed estimator_gps_vert_pos_drift_too_high estimator_gps_vert_pos_err_too_high
estimator_gps_vert_speed_drift_too_high estimator_heading_not_stable estimator_hgt_not_stable
estimator_high_accel_bias estimator_high_gyro_bias estimator_hor_pos_not_stable estimator_hor_vel_not_stable
estimator_low_position_accuracy estimator_mag_fault estimator_mag_interference estimator_missing_data
estimator_position_failure_imminent estimator_vert_vel_not_stable external_modes_unavailable
external_modes_unresponsive failure_detector_alt failure_detector_arm_esc failure_detector_ext
failure_detector_imbalanced_prop failure_detector_motor failure_detector_pitch failure_detector_roll
flight_time_limit gf_no_home gf_violation_custom_gf gf_violation_max_alt gf_violation_max_hor_dist gyro_missing
gyro_no_data gyro_not_calibrated hardfault_present high_wind_warning imu_accel_inconsistent imu_gyro_inconsistent
mag_consistency mag_fault mag_missing mag_no_data mag_not_calibrated mag_sys_has_mag_missing
man_control_kill_engaged man_control_landing_gear_up man_control_rtl_engaged missing_cpuload missing_fmu_sdcard
missing_system_power mission_failure modes_angular_velocity modes_attitude modes_cannot_takeoff modes_global_pos
modes_home_position modes_local_alt modes_local_pos modes_manual_control modes_mission modes_offboard_signal
navigator_failure_hagl open_drone_id_missing open_drone_id_unhealthy optical_flow_sensor_invalid
optical_sensor_missing parachute_missing parachute_unhealthy power_oc_hipower power_oc_periph power_oc_report
ram_usage_too_high rc_dl_no_dllink rc_max_too_high rc_min_too_small rc_trim_too_high rc_trim_too_small
system_arm_auth_failed system_flight_term_active system_no_global_pos system_no_home_pos system_safety_button
system_usb_connected system_vtol_in_fw_mode system_vtol_in_transition wind_too_high
"""
"""Each of them is prefixed with `check_`."""
_CHECKS_1_18 = """
companion_computer_temperature_high esc_over_temperature escs_not_all_armed estimator_gnss_warning_jamming
estimator_gps_jammed estimator_heading_no_source gnss_receiver_no_fix gnss_receiver_offline gps_position_divergence
modes_offboard_no_attitude modes_offboard_no_local_position modes_offboard_no_local_velocity
modes_offboard_signal_lost motor_overcurrent motor_undercurrent rally_point_missing task_watchdog_present
traffic_avoidance_missing
"""
"""Checks that 1.18 has added."""

_CRITICAL_LEVEL = 2
"""An external log level: critical. Lower ones are worse."""
_SEVERE_NAMES = """
commander_failsafe_enter commander_failsafe_enter_generic commander_failsafe_enter_hold
commander_failsafe_enter_generic_hold commander_failsafe_enter_autopilot_disengaged
commander_failsafe_enter_crit_bat_warn commander_failsafe_enter_crit_low_bat_warn
commander_high_latency_lost commander_mission_comp_lost
commander_remote_id_lost commander_low_bat_shutdown commander_low_bat_shutdown_failed
commander_kill_sw_engaged commander_mission_start_denied_no_mission mavlink_mission_storage_write_failure2
mavlink_mission_storage_write_failure3 px4io_comm_failed px4io_config_read_failed px4io_proto_fw_mismatch
sensor_failover sensor_failover_baro sensor_failover_mag vehicle_imu_accel_clipping vehicle_imu_gyro_clipping
commander_mode_fallback_internal commander_load_param_failed commander_save_param_failed
navigator_transition_descend navigator_mission_failure_heading navigator_terrain_collision_risk
navigator_geofence_invalid_against_home navigator_geofence_invalid_against_cur_pos navigator_geofence_import_failed
"""
"""Names of this level that are no refusals and no checks."""

NAVIGATION_STATES = {
    "MANUAL": 0,
    "ALTCTL": 1,
    "POSCTL": 2,
    "AUTO.MISSION": 3,
    "AUTO.LOITER": 4,
    "AUTO.RTL": 5,
    "POSCTL.SLOW": 6,
    "AUTO.COURSE": 7,
    "ALTITUDE_CRUISE": 8,
    "ACRO": 10,
    "OFFBOARD": 14,
    "STABILIZED": 15,
    "AUTO.TAKEOFF": 17,
    "AUTO.LAND": 18,
    "AUTO.FOLLOW_TARGET": 19,
    "AUTO.PRECLAND": 20,
    "POSCTL.ORBIT": 21,
    "AUTO.VTOL_TAKEOFF": 22,
}
"""PX4's numbers of its modes (vehicle_status ``nav_state``), by which a failed check lists those that it concerns."""


@dataclass(frozen=True, slots=True)
class Event:
    """Event of an autopilot: that it was armed or disarmed, the reason of a refusal, the trigger of a failsafe; perhaps
    nothing of these.

    `boot_s` is when it happened, as time since the autopilot's boot. `begins_report` is whether a report of all its
    checks begins, in which each further event names a check that fails (`is_check`). `lasting` is its number where
    later reports name it again, whatever triggers a failsafe then; else 0. `severity` is that of `severe_text`, which
    is empty where it is less than critical, and for checks.
    """

    boot_s: float
    armed: bool | None = None
    text: str = ""
    cause: Cause | None = None
    begins_report: bool = False
    is_check: bool = False
    lasting: int = 0
    severe_text: str = ""
    severity: int = 7


def event_id(name: str) -> int:
    """Returns the id of the autopilot's event of a name: its FNV-1a hash, 24 bits, below the component."""
    value = 0x811C9DC5
    for byte in name.encode("ascii"):
        value = (value ^ byte) * 0x01000193 & 0xFFFFFFFF
    return value & 0xFFFFFF | AUTOPILOT_ID


_ARMED = {event_id("commander_armed_by"): True, event_id("commander_disarmed_by"): False}
_CHECK_NAMES = [f"check_{name}" for name in (*_CHECKS.split(), *_CHECKS_1_18.split())]
_TEXTS = {
    event_id(name): name.removeprefix("commander_").replace("_", " ") for name in (*_DENIALS.split(), *_CHECK_NAMES)
}
_CHECK_IDS = frozenset(map(event_id, _CHECK_NAMES))

_SEVERE_TEXTS = {
    event_id(name): name.removeprefix("commander_").replace("_", " ")
    for name in (*_SEVERE_NAMES.split(), *_DENIALS.split())
}

_REPORT_BEGINS = event_id("commander_arming_check_summary")
"""The first event of each report of all checks."""
_CAUSE_AT = {event_id("commander_failsafe_enter_hold"): 7, event_id("commander_failsafe_enter"): 5}
"""Events with which a failsafe begins, and where the number of its cause is in their arguments. Those without a cause
(``..._generic``, ``..._generic_hold``) follow the event of what triggered it."""
_CAUSES = {
    1: Cause.RC,
    2: Cause.GROUND_STATION_LOST,
    3: Cause.BATTERY,
    4: Cause.BATTERY,
    5: Cause.BATTERY,
    6: Cause.BATTERY,
}
"""PX4's numbers: manual control lost, ground station lost, battery low, critical, emergency, low flight time."""
_TRIGGERS = {
    event_id("commander_rc_lost"): Cause.RC,
    event_id("commander_gcs_lost"): Cause.GROUND_STATION_LOST,
    event_id("check_battery_critical"): Cause.BATTERY,
    event_id("check_battery_emergency"): Cause.BATTERY,
    event_id("check_gf_violation_max_hor_dist"): Cause.FENCE,
    event_id("check_gf_violation_max_alt"): Cause.FENCE,
    event_id("check_gf_violation_custom_gf"): Cause.FENCE,
    event_id("check_flight_time_limit"): Cause.FLIGHT_TIME,
    event_id("check_modes_local_pos"): Cause.POSITION,
    event_id("check_modes_global_pos"): Cause.POSITION,
    event_id("check_modes_offboard_no_local_position"): Cause.POSITION,
    event_id("check_modes_offboard_no_local_velocity"): Cause.POSITION,
    event_id("check_gnss_receiver_offline"): Cause.POSITION,
    event_id("check_gnss_receiver_no_fix"): Cause.POSITION,
    event_id("check_gps_position_divergence"): Cause.POSITION,
}
_LASTING = {event_id(f"check_{name}") for name in ("battery_critical", "battery_emergency", "flight_time_limit")}
"""PX4 does not take these back in a flight."""
_OFFBOARD_SIGNAL = {event_id("check_modes_offboard_signal"), event_id("check_modes_offboard_signal_lost")}
"""No setpoints come: until 1.17, and from 1.18 on. PX4 reports it 10 ms before the failsafe, whose own event has no
cause; in other modes, too."""


def read(number: int, boot_s: float, levels: int, arguments: bytes, mode: str) -> Event:
    """Returns the content of an event: its id, when it happened, its log levels and its arguments. A failed check that
    does not concern the present mode, given by its name, has no text.
    """
    if number in _ARMED:
        return Event(boot_s, armed=_ARMED[number])
    if number == _REPORT_BEGINS:
        return Event(boot_s, begins_report=True)
    cause, lasting = _cause(number, arguments, mode), number if number in _LASTING else 0
    text, severity = _TEXTS.get(number, ""), levels & 0xF
    severe_text = ""
    if severity <= _CRITICAL_LEVEL and number not in _CHECK_IDS:
        severe_text = _SEVERE_TEXTS.get(number, f"event {number}, of which UAL knows no name")
    if not text or severity > _WARNING_LEVEL or not _concerns(number, arguments, mode):
        return Event(boot_s, cause=cause, lasting=lasting, severe_text=severe_text, severity=severity)
    is_check = number in _CHECK_IDS
    return Event(
        boot_s, None, text, cause, is_check=is_check, lasting=lasting, severe_text=severe_text, severity=severity
    )


def _cause(number: int, arguments: bytes, mode: str) -> Cause | None:
    """Returns what an event says of the cause of a failsafe in a mode; None if it says nothing."""
    if number in _OFFBOARD_SIGNAL:
        return Cause.SETPOINTS if mode == "OFFBOARD" else None
    index = _CAUSE_AT.get(number)
    return _TRIGGERS.get(number) if index is None else _CAUSES.get(arguments[index])


def _concerns(number: int, arguments: bytes, mode: str) -> bool:
    """Returns whether an event concerns a mode; true where either of them is not known."""
    state = NAVIGATION_STATES.get(mode)
    if number not in _CHECK_IDS or state is None:
        return True
    (modes,) = struct.unpack_from("<I", arguments)
    return bool(modes >> state & 1)
