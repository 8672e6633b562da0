"""Failures of the vehicle, and a second station: by the autopilots' and simulators' parameters and commands."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from pymavlink.dialects.v20 import all as mavlink

from tests.campaign.plan import Fault
from tests.campaign.rig import Rig
from tests.sitl.transmitter import Sticks
from tests.sitl.troubles import Change, changed

Wait = Callable[[float], object]
"""Waits so long, or until the flight is over."""

_NARROW_M, _WIDE_M, _WIDER_M = 2.0, 5.0, 4.0


def _fences(radius_m: Callable[[float], float]) -> Mapping[str, Callable[[float], tuple[Change, ...]]]:
    """The autopilot's own fence, a circle around its home."""
    return {
        "px4": lambda strength: (Change("GF_MAX_HOR_DIST", radius_m(strength), 150.0),),
        "ardupilot": lambda strength: (
            Change("FENCE_TYPE", 2.0, 2.0),
            Change("FENCE_RADIUS", radius_m(strength), 150.0),
            Change("FENCE_ENABLE", 1.0, 0.0),
        ),
    }


_CHANGES: Mapping[str, Mapping[str, Callable[[float], tuple[Change, ...]]]] = {
    "fence": _fences(lambda _: _NARROW_M),
    "wide_fence": _fences(lambda strength: _WIDE_M + _WIDER_M * strength),
    "limits": {
        "px4": lambda _: (Change("MPC_XY_CRUISE", 1.0, 5.0), Change("MPC_XY_VEL_MAX", 1.5, 12.0)),
        "ardupilot": lambda _: (Change("WPNAV_SPEED", 150.0, 1000.0), Change("WPNAV_SPEED_UP", 80.0, 250.0)),
    },
    "motor_weak": {
        "ardupilot": lambda strength: (Change("SIM_ENGINE_MUL", 0.3 + 0.4 * strength, 1.0),),
        "px4": lambda strength: (Change("SIH_T_MAX", 1.5 + 0.8 * strength, 5.0),),
    },
    "gps_jam": {"ardupilot": lambda _: (Change("SIM_GPS_JAM", 1.0, 0.0),)},
    "gps_jump": {"ardupilot": lambda strength: (Change("SIM_GPS_GLITCH_X", 1e-4 + 5e-4 * strength, 0.0),)},
    "compass": {
        "ardupilot": lambda _: tuple(Change(f"SIM_MAG{number}_FAIL", 1.0, 0.0) for number in (1, 2, 3)),
        "px4": lambda strength: (Change("SIM_MAG_OFFSET_X", 0.1 + 0.3 * strength, 0.0),),
    },
    "barometer": {
        "ardupilot": lambda strength: (Change("SIM_BARO_GLITCH", 2.0 + 6.0 * strength, 0.0),),
        "px4": lambda strength: (Change("SIM_BARO_OFF_P", 0.1 + 0.4 * strength, 0.0),),
    },
    "accelerometer": {"ardupilot": lambda strength: (Change("SIM_ACC1_BIAS_X", 1.0 + 3.0 * strength, 0.0),)},
    "wind": {
        "ardupilot": lambda strength: (
            Change("SIM_WIND_DIR", 360.0 * strength, 180.0),
            Change("SIM_WIND_TURB", 3.0 * strength, 0.0),
            Change("SIM_WIND_SPD", 4.0 + 8.0 * strength, 0.0),
        ),
    },
}
"""By the fault, and by the autopilot; from its strength. What a simulator lacks has no effect."""
_STOP_OPTION, _HIGH, _LOW = 31.0, 2.0, 0.0
"""ArduPilot's auxiliary function that stops the motors, and the positions of its switch."""
_DO_AUX_FUNCTION, _INJECT_FAILURE = 218, 420
_MOTOR, _IS_OFF, _IS_WELL = 101.0, 1.0, 0.0
_KILLING = Sticks(forward=-1.0, right=1.0, up=-1.0, turn_right=-1.0)
"""PX4's gesture of both sticks that stops the motors (MAN_KILL_GEST_T). Nothing but the disarming releases it."""
_GESTURE_S = 1.0
_CLAMP_CHANNEL, _CLAMPED_US, _FREE_US = 9.0, 2000.0, 1000.0
_FORCE = 21196.0


def _changes(rig: Rig, fault: Fault, wait: Wait) -> None:
    made = _CHANGES[fault.kind].get(rig.options.autopilot)
    if made is not None:
        with changed(rig.pilot, made(fault.strength)):
            wait(2.0 + fault.duration_s)


def _motor_off(rig: Rig, fault: Fault, wait: Wait) -> None:
    """One motor is dead."""
    if rig.options.autopilot == "ardupilot":
        with changed(rig.pilot, (Change("SIM_ENGINE_MUL", 0.0, 1.0),)):
            wait(fault.duration_s)
        return
    rig.must_boot = True  # it may be terminated: PX4 leaves that mode by a boot only
    rig.pilot.order(_INJECT_FAILURE, (_MOTOR, _IS_OFF, float(math.floor(1 + 3.9 * fault.strength))))
    wait(fault.duration_s)
    rig.pilot.order(_INJECT_FAILURE, (_MOTOR, _IS_WELL, 0.0))


def _stop(rig: Rig, fault: Fault, wait: Wait) -> None:
    """The pilot stops all motors, and on ArduPilot lets them run again."""
    if rig.options.autopilot == "ardupilot":
        rig.pilot.order(_DO_AUX_FUNCTION, (_STOP_OPTION, _HIGH))
        wait(fault.duration_s)
        rig.pilot.order(_DO_AUX_FUNCTION, (_STOP_OPTION, _LOW))
        return
    rig.must_boot = True  # before that it is not armed again
    rig.pilot.sticks = _KILLING
    wait(_GESTURE_S)
    rig.pilot.sticks = Sticks()


def _disarmed(rig: Rig, _fault: Fault, _wait: Wait) -> None:
    """Another station disarms it in the air."""
    rig.pilot.order(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (0.0, _FORCE))


def _held(rig: Rig, fault: Fault, wait: Wait) -> None:
    """Something holds it on the ground, or its motors are too weak, while it is to take off."""
    with _holding(rig):
        wait(4.0 * fault.duration_s)


@contextmanager
def _holding(rig: Rig) -> Iterator[None]:
    if rig.options.autopilot == "px4":
        with changed(rig.pilot, (Change("SIH_T_MAX", 1.0, 5.0),)):
            yield
        return
    rig.pilot.set_parameter("SIM_CLAMP_CH", _CLAMP_CHANNEL)
    rig.pilot.order(mavlink.MAV_CMD_DO_SET_SERVO, (_CLAMP_CHANNEL, _CLAMPED_US))
    try:
        yield
    finally:
        rig.pilot.order(mavlink.MAV_CMD_DO_SET_SERVO, (_CLAMP_CHANNEL, _FREE_US))


# --- A second station -------------------------------------------------------------------------------------------------


def _station_upload(rig: Rig, fault: Fault, _wait: Wait) -> None:
    """Another station replaces the mission, by one with another number of items."""
    east_m = 4.0 * fault.strength - 2.0
    rig.upload_mission([(east_m, north_m, 3.0) for north_m in (-3.0, 3.0)])


def _station_clear(rig: Rig, _fault: Fault, _wait: Wait) -> None:
    rig.upload_mission([])


def _station_jump(rig: Rig, _fault: Fault, _wait: Wait) -> None:
    rig.note("jump")
    rig.pilot.order(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, (2.0,))


def _station_parameter(rig: Rig, fault: Fault, wait: Wait) -> None:
    """Another station changes a parameter that bears on nothing that is judged, and back."""
    change = {"px4": Change("MPC_ACC_DOWN_MAX", 2.5, 3.0), "ardupilot": Change("PSC_JERK_Z", 4.0, 5.0)}
    rig.note("parameter")
    with changed(rig.pilot, (change[rig.options.autopilot],)):
        wait(fault.duration_s)


def _station_reboot(rig: Rig, _fault: Fault, _wait: Wait) -> None:
    """Another station has it boot, which no autopilot does in the air."""
    rig.note("reboot")
    rig.pilot.order(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, (1.0,))


def _cut(rig: Rig, fault: Fault, wait: Wait) -> None:
    """The line falls silent amid an upload, and its client is gone."""
    wait(0.1 * fault.strength)
    rig.set_link(is_silent=True)
    wait(0.3)
    rig.kill_client()
    wait(fault.duration_s / 4.0)
    rig.set_link(is_silent=False)


FAILURES: dict[str, Callable[[Rig, Fault, Wait], None]] = {
    **dict.fromkeys(_CHANGES, _changes),
    "motor_off": _motor_off,
    "stop": _stop,
    "disarmed": _disarmed,
    "held": _held,
    "station_upload": _station_upload,
    "station_clear": _station_clear,
    "station_jump": _station_jump,
    "station_parameter": _station_parameter,
    "station_reboot": _station_reboot,
    "cut": _cut,
}
