"""PX4: flown in OFFBOARD mode. Measured with 1.17 (docs/reference/backends/mavlink.md)."""

from __future__ import annotations

import math
from collections.abc import Mapping

from typing_extensions import override

from ual.types import Capability, Limits
from ual_daemon.backends.firmwares.autopilot import (
    Autopilot,
    AutopilotBoard,
    SimulationVerdict,
    fence_limit,
    positive_parameter,
)
from ual_daemon.backends.firmwares.feed_forward import VELOCITY_GAINS
from ual_daemon.backends.firmwares.fence_zones import UNREAD, FoundZones
from ual_daemon.backends.firmwares.gimbal_codec import Px4Gimbal
from ual_daemon.backends.firmwares.gripper_codec import Px4Gripper
from ual_daemon.backends.firmwares.mission_codec import Px4Missions
from ual_daemon.backends.firmwares.mission_items import MissionType
from ual_daemon.backends.firmwares.numbers import Sensor, VtolState
from ual_daemon.backends.offers.fence import FenceSwitch
from ual_daemon.backends.values import (
    NO_FENCE,
    AutopilotFence,
    Cause,
    Control,
    Mode,
    OnArming,
    VelocityResponse,
    VelocityResponses,
)
from ual_daemon.geodesy import Projection, SphereProjection

_HOLD_AT_FENCE = 2
"""GF_ACTION by which it holds its position at its fence. 1 only warns."""
_MAIN = {
    1: "MANUAL",
    2: "ALTCTL",
    3: "POSCTL",
    4: "AUTO",
    5: "ACRO",
    6: "OFFBOARD",
    7: "STABILIZED",
    10: "TERMINATION",
    11: "ALTITUDE_CRUISE",
}
_SUB_POSCTL = {1: "ORBIT", 2: "SLOW"}
_SUB_AUTO = {
    1: "READY",
    2: "TAKEOFF",
    3: "LOITER",
    4: "MISSION",
    5: "RTL",
    6: "LAND",
    8: "FOLLOW_TARGET",
    9: "PRECLAND",
    10: "VTOL_TAKEOFF",
    19: "COURSE",
}
_EXTERNAL = {10 + number: f"EXTERNAL{number}" for number in range(1, 9)}
"""Modes that other programs fly. What they are called is theirs to say."""
_SUB = {"POSCTL": _SUB_POSCTL, "AUTO": _SUB_AUTO | _EXTERNAL}
_CONTROL = {
    "OFFBOARD": Control.REFERENCES,
    "AUTO.TAKEOFF": Control.TAKE_OFF,
    "AUTO.VTOL_TAKEOFF": Control.TAKE_OFF,
    "AUTO.LAND": Control.LAND,
    "AUTO.PRECLAND": Control.LAND,
}
_AUTONOMOUS = frozenset({"AUTO.LOITER", "AUTO.MISSION", "AUTO.RTL", "AUTO.FOLLOW_TARGET", "POSCTL.ORBIT"})
_PILOTS_MODES = frozenset({"MANUAL", "ALTCTL", "POSCTL", "ACRO", "STABILIZED", "POSCTL.SLOW", "ALTITUDE_CRUISE"})
_KEEPING_HEIGHT = frozenset({"ALTCTL", "POSCTL", "POSCTL.SLOW", "ALTITUDE_CRUISE"})
"""Pilot's modes in which it bounds the descent (MPC_Z_VEL_MAX_DN)."""
_ON_ARMING = {
    **dict.fromkeys((*_PILOTS_MODES, "AUTO.LOITER"), OnArming.STANDS),
    "OFFBOARD": OnArming.REFUSES,  # without a stream of setpoints; PX4 enters it by itself after we have landed it
    "TERMINATION": OnArming.REFUSES,
    "AUTO.RTL": OnArming.REFUSES,
    "AUTO.LAND": OnArming.REFUSES,
    "AUTO.PRECLAND": OnArming.REFUSES,
    "AUTO.FOLLOW_TARGET": OnArming.REFUSES,
    "POSCTL.ORBIT": OnArming.REFUSES,
    "AUTO.TAKEOFF": OnArming.FLIES,
    "AUTO.VTOL_TAKEOFF": OnArming.FLIES,
    "AUTO.MISSION": OnArming.FLIES,  # in which it is again after the landing of a mission, or of UAL out of one
}
"""By its mode_requirements.cpp (mode_req_prevent_arming, offboard signal). In another one another program may fly."""

OFFBOARD_NEEDS_SETPOINTS_S = 0.4
"""Seconds for which setpoints must have come before PX4 accepts OFFBOARD: without them it refuses the mode, or the
arming.
"""

_SHORTEST_LOSS_S = 0.2
"""A COM_OF_LOSS_T below this is not followed: each jitter of the link would be a lost link."""
_SIMULATION_UID = int.from_bytes(b"ONIDLATI", "little")
"""The unique id of the first vehicle of PX4's simulator (its board says ``SIMULATIONID0000``). The ids of the next ones
are higher by their system id."""

ACCELERATION_SHARE = 0.6
"""The part of PX4's own acceleration limits that our references may use: with all of it PX4 overshoots by more than
0.4 m, whatever the feed-forward (benchmarks/tracker.md)."""
_CAREFUL = Limits(
    horizontal_speed_m_s=1.6,
    climb_speed_m_s=1.2,
    descent_speed_m_s=1.0,
    horizontal_acceleration_m_s2=3.0 * ACCELERATION_SHARE,
    vertical_acceleration_m_s2=2.0 * ACCELERATION_SHARE,
    yaw_rate_rad_s=math.radians(45.0),
)
"""No higher than what any version from 1.13 on, or any of its airframes, ships: MPC_XY_VEL_MAX 5, MPC_Z_VEL_MAX_UP 3,
MPC_Z_VEL_MAX_DN 1, MPC_ACC_HOR 3, MPC_ACC_DOWN_MAX 2 (4061_atl_mantis_edu), MPC_YAWRAUTO_MAX 45."""
_CAREFUL_CRUISE_M_S = 5.0
"""The MPC_XY_CRUISE that all of them ship."""
_LINK_S, _RISE_S = 0.1, 0.12
"""Seconds until it hears of a velocity, and the rise time of its horizontal acceleration then: it tilts within 0.15
s.
"""
_HORIZONTAL, _VERTICAL = VELOCITY_GAINS, {"MPC_Z_VEL_P_ACC": 4.0, "MPC_Z_VEL_D_ACC": 0.0}
_GAINS = (*_HORIZONTAL, *_VERTICAL)
"""The gains of its velocity. Their defaults count where they are not read."""


class Px4(Autopilot):
    """PX4 multirotors, from 1.13."""

    name = "PX4"
    gripper = Px4Gripper(name)
    gimbal = Px4Gimbal()
    sends_image_captured = True
    capabilities = frozenset(Capability)
    sends_landed_state = True
    setpoint_mode, hold_mode, land_mode = "OFFBOARD", "AUTO.LOITER", "AUTO.LAND"
    termination_mode = "TERMINATION"
    arming_mode = hold_mode
    setpoints_before_mode_s = OFFBOARD_NEEDS_SETPOINTS_S
    takes_feed_forward = True
    takes_acceleration = True
    on_arming, on_arming_elsewhere = _ON_ARMING, OnArming.MAY_FLY
    pilots_modes = _PILOTS_MODES
    fallback_mode = "POSCTL"  # COM_OBL_RC_ACT 0; without a transmitter it returns
    parameters = (
        "MPC_XY_VEL_MAX",
        "MPC_Z_VEL_MAX_UP",
        "MPC_Z_VEL_MAX_DN",
        "MPC_ACC_HOR",
        "MPC_ACC_UP_MAX",
        "MPC_ACC_DOWN_MAX",
        "MPC_YAWRAUTO_MAX",
        "MPC_XY_CRUISE",
        "COM_OF_LOSS_T",
        "GF_ACTION",
        "GF_MAX_HOR_DIST",
        "GF_MAX_VER_DIST",
        *_GAINS,
    )
    optional_parameters = frozenset(_GAINS)
    parameters_checksum = "_HASH_CHECK"
    failsafe_parameters = frozenset(
        {
            "COM_ACT_DELAY",
            "COM_DISARM_LAND",
            "COM_DL_LOSS_T",
            "COM_FAIL_ACT_T",
            "COM_GNSSLOSS_ACT",
            "COM_FLT_TIME_MAX",
            "COM_LOW_BAT_ACT",
            "COM_OBL_RC_ACT",
            "COM_POSCTL_NAVL",
            "COM_POS_FS_EPH",
            "COM_RC_IN_MODE",
            "COM_RC_LOSS_T",
            "COM_RC_OVERRIDE",
            "COM_RC_STICK_OV",
            "COM_RCL_EXCEPT",
            "CBRK_FLIGHTTERM",
            "MAN_OVERRIDE_SPD",
            "MAV_COMP_ID",
            "MAV_SYS_ID",
            "NAV_DLL_ACT",
            "NAV_RCL_ACT",
            "RTL_RETURN_ALT",
            "SYS_HAS_NUM_GNSS",
        }
    )
    has_zones = True
    missions = Px4Missions()
    keeps_parts_of: frozenset[MissionType] = frozenset()
    fence_switches = (FenceSwitch("GF_ACTION", _HOLD_AT_FENCE, least=_HOLD_AT_FENCE),)

    @override
    def mode(self, custom_mode: int) -> Mode:
        main_number, sub_number = custom_mode >> 16 & 0xFF, custom_mode >> 24
        name = _MAIN.get(main_number, f"MODE{main_number}")
        if sub_number:
            name = f"{name}.{_SUB.get(name, {}).get(sub_number, sub_number)}"
        return self.mode_named(name)

    @override
    def names_mode(self, custom_mode: int) -> bool:
        name, sub_number = _MAIN.get(custom_mode >> 16 & 0xFF), custom_mode >> 24
        is_external = name == "AUTO" and sub_number in _EXTERNAL
        return name is not None and (not sub_number or sub_number in _SUB.get(name, {})) and not is_external

    @override
    def mode_named(self, name: str) -> Mode:
        return Mode(
            name,
            _CONTROL.get(name, Control.OTHER),
            is_autonomous=name in _AUTONOMOUS,
            on_arming=_ON_ARMING.get(name, self.on_arming_elsewhere),
            keeps_height=name in _KEEPING_HEIGHT,
        )

    @override
    def projection(self, latitude_deg: float, longitude_deg: float, altitude_amsl_m: float) -> Projection:
        return SphereProjection(latitude_deg, longitude_deg, altitude_amsl_m)

    @override
    def judge_simulation(
        self, version: AutopilotBoard | None, parameters: Mapping[str, float], system_id: int
    ) -> SimulationVerdict:
        if version is None:
            return SimulationVerdict(None, "its version and unique id are not known yet")
        if version.uid != _SIMULATION_UID + system_id - 1:
            return SimulationVerdict(False, f"its unique id is {version.uid:#018x}, a flight controller's")
        return SimulationVerdict(True)

    @override
    def is_multirotor(self, vtol_state: int, parameters: Mapping[str, float]) -> bool:
        return vtol_state == VtolState.UNDEFINED

    @override
    def failsafe_of_sensors(self, failing: int, healthy_once: int) -> Cause | None:
        # Its battery counts as unhealthy from the first warning on, and its fence never. A transmitter that was never
        # heard is none that was lost: PX4 flies without one.
        is_lost = failing & healthy_once & Sensor.RC_RECEIVER
        return Cause.RC if is_lost else None

    @override
    def limits(self, parameters: Mapping[str, float]) -> Limits:
        careful, share = _CAREFUL, ACCELERATION_SHARE
        yaw_rate_deg_s = positive_parameter(parameters, "MPC_YAWRAUTO_MAX", math.degrees(careful.yaw_rate_rad_s))

        def acceleration(name: str, otherwise: float) -> float:
            return positive_parameter(parameters, name, otherwise, share=share)

        return Limits(
            horizontal_speed_m_s=positive_parameter(parameters, "MPC_XY_VEL_MAX", careful.horizontal_speed_m_s),
            climb_speed_m_s=positive_parameter(parameters, "MPC_Z_VEL_MAX_UP", careful.climb_speed_m_s),
            descent_speed_m_s=positive_parameter(parameters, "MPC_Z_VEL_MAX_DN", careful.descent_speed_m_s),
            horizontal_acceleration_m_s2=acceleration("MPC_ACC_HOR", careful.horizontal_acceleration_m_s2),
            vertical_acceleration_m_s2=min(
                acceleration(name, careful.vertical_acceleration_m_s2)
                for name in ("MPC_ACC_UP_MAX", "MPC_ACC_DOWN_MAX")
            ),
            yaw_rate_rad_s=math.radians(yaw_rate_deg_s),
        )

    @override
    def acceleration_share(self, parameters: Mapping[str, float]) -> float:
        return ACCELERATION_SHARE if "MPC_ACC_HOR" in parameters else 1.0

    @override
    def velocity_responses(self, parameters: Mapping[str, float]) -> VelocityResponses:
        return VelocityResponses(
            VelocityResponse(_response_s(parameters, _HORIZONTAL), delay_s=_LINK_S, rise_s=_RISE_S),
            VelocityResponse(_response_s(parameters, _VERTICAL)),
        )

    @override
    def cruise_speed_m_s(self, parameters: Mapping[str, float]) -> float:
        return positive_parameter(parameters, "MPC_XY_CRUISE", _CAREFUL_CRUISE_M_S)

    @override
    def setpoints_lost_s(self, parameters: Mapping[str, float]) -> float:
        return max(_SHORTEST_LOSS_S, parameters.get("COM_OF_LOSS_T", math.inf))

    @override
    def autopilot_fence(
        self, parameters: Mapping[str, float], *, is_enabled: bool, found: FoundZones = UNREAD
    ) -> AutopilotFence:
        if not parameters.get("GF_ACTION"):
            return NO_FENCE
        unread = "" if found.zones is not None else "a fence of polygons, if it has one"
        return AutopilotFence(
            fence_limit(parameters, "GF_MAX_HOR_DIST"),
            fence_limit(parameters, "GF_MAX_VER_DIST"),
            unread=f"its polygons and circles: {found.why}" if found.why else unread,
            is_cut_by_unread=bool(found.why),
            zones=found.zones or (),  # it must be inside all inclusions (Geofence::isInsidePolygonOrCircle)
        )


def _response_s(parameters: Mapping[str, float], gains: Mapping[str, float]) -> float:
    """Returns the time constant of its velocity, by its gains and their defaults.

    PositionControl.cpp accelerates by P (wanted - v) - D a: so a (1 + D) = P (wanted - v).
    """
    (p_name, p), (d_name, d) = gains.items()
    return (1.0 + parameters.get(d_name, d)) / positive_parameter(parameters, p_name, p)
