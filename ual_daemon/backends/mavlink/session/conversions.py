"""From the content of MAVLink messages to UAL's value types and units."""

from __future__ import annotations

from operator import attrgetter

from ual.types import Battery, GeoPoint, GpsFix, GpsInfo
from ual_daemon.backends.firmwares.batteries import FUNCTIONS
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.values import LandedState

_LANDED = {
    mavlink.MAV_LANDED_STATE_ON_GROUND: LandedState.ON_GROUND,
    mavlink.MAV_LANDED_STATE_IN_AIR: LandedState.IN_AIR,
    mavlink.MAV_LANDED_STATE_TAKEOFF: LandedState.TAKING_OFF,
    mavlink.MAV_LANDED_STATE_LANDING: LandedState.LANDING,
}
_FIX = {
    mavlink.GPS_FIX_TYPE_2D_FIX: GpsFix.FIX_2D,
    mavlink.GPS_FIX_TYPE_3D_FIX: GpsFix.FIX_3D,
    mavlink.GPS_FIX_TYPE_DGPS: GpsFix.DIFFERENTIAL,
    mavlink.GPS_FIX_TYPE_RTK_FLOAT: GpsFix.RTK_FLOAT,
    mavlink.GPS_FIX_TYPE_RTK_FIXED: GpsFix.RTK_FIXED,
    mavlink.GPS_FIX_TYPE_STATIC: GpsFix.FIX_3D,
    mavlink.GPS_FIX_TYPE_PPP: GpsFix.FIX_3D,
}
_UNKNOWN_U16_CODE = 0xFFFF
_UNKNOWN_U8_CODE = 0xFF


def milli(value: int) -> float:
    """Converts thousandths (mm, ms, mV) to the unit."""
    return value / 1000.0


def degrees(value: int) -> float:
    """Converts 1e-7 degrees to degrees."""
    return value / 1e7


def landed_state(value: int) -> LandedState:
    """Converts a MAV_LANDED_STATE."""
    return _LANDED.get(value, LandedState.UNKNOWN)


def battery(message: Message) -> Battery | None:
    """Returns the battery of a SYS_STATUS; None where it has no value."""
    voltage, current, remaining = message.voltage_battery, message.current_battery, message.battery_remaining
    found = Battery(
        remaining_percent=None if remaining < 0 else float(remaining),
        voltage_v=None if voltage in (0, _UNKNOWN_U16_CODE) else milli(voltage),  # 0 from ArduPilot without a monitor
        current_a=None if current < 0 else current / 100.0,  # unknown: -1 in MAVLink, -100 from PX4
    )
    return None if found == Battery() else found


def battery_status(message: Message) -> Battery:
    """Returns the battery of a BATTERY_STATUS: the sum of its cells, where they are reported."""
    cells = [each for each in message.voltages if each != _UNKNOWN_U16_CODE]
    millivolts = sum(cells) + sum(getattr(message, "voltages_ext", ()))  # the latter are 0 where there are no more
    current, remaining = message.current_battery, message.battery_remaining
    return Battery(
        remaining_percent=None if remaining < 0 else float(remaining),
        voltage_v=milli(millivolts) if millivolts else None,
        current_a=None if current < 0 else current / 100.0,
        id=message.id,
        function=FUNCTIONS.get(message.battery_function, ""),
    )


def gps_info(message: Message) -> GpsInfo:
    """Returns the fix of a GPS_RAW_INT."""
    satellites_count = message.satellites_visible
    return GpsInfo(
        _FIX.get(message.fix_type, GpsFix.NONE),
        satellites_count=None if satellites_count in (0, _UNKNOWN_U8_CODE) else satellites_count,
        horizontal_accuracy_m=milli(message.h_acc) or None,  # 0 where it is not known
        vertical_accuracy_m=milli(message.v_acc) or None,
    )


def geo_point(message: Message, geoid_separation_m: float | None) -> GeoPoint | None:
    """Returns the position of a GLOBAL_POSITION_INT; None for the zeros that ArduPilot sends before its first fix."""
    if message.lat == message.lon == 0:
        return None
    altitude_m = message.alt / 1000.0  # as `milli` and `degrees`: 50 come each second
    ellipsoid_m = None if geoid_separation_m is None else altitude_m + geoid_separation_m
    return GeoPoint(message.lat / 1e7, message.lon / 1e7, altitude_m, message.relative_alt / 1000.0, ellipsoid_m)


def channels(message: Message) -> list[int]:
    """Returns the channels of an RC_CHANNELS, in microseconds."""
    return [getattr(message, f"chan{number}_raw") for number in range(1, min(message.chancount, 18) + 1)]


pulses = attrgetter(*(f"servo{number}_raw" for number in range(1, 17)))
"""Returns the pulses of a SERVO_OUTPUT_RAW, in microseconds."""
