"""Values of parameters as each autopilot sends them; and the numbers that all protocols share are MAVLink's."""

from __future__ import annotations

import struct

from pymavlink.dialects.v20 import all as mavlink

from ual_daemon.backends.firmwares import numbers
from ual_daemon.backends.mavlink.dialects.ardupilot import ArduCopter
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.wire.messages import Message


def _value(number: float, kind: int) -> Message:
    return mavlink.MAVLink_param_value_message(b"ANY", number, kind, 1, 0)


def test_integers_are_read_as_each_autopilot_sends_them() -> None:
    (bytes_of_2,) = struct.unpack("<f", struct.pack("<i", 2))
    assert Px4().parameter_value(_value(bytes_of_2, mavlink.MAV_PARAM_TYPE_INT32)) == 2.0
    assert Px4().parameter_value(_value(2.5, mavlink.MAV_PARAM_TYPE_REAL32)) == 2.5
    assert Px4().parameter_value(_value(2.5, mavlink.MAV_PARAM_TYPE_UINT8)) is None
    assert ArduCopter().parameter_value(_value(7.0, mavlink.MAV_PARAM_TYPE_INT8)) == 7.0


def test_the_shared_numbers_are_mavlinks() -> None:
    sensor_prefixes = ("MAV_SYS_STATUS_SENSOR_", "MAV_SYS_STATUS_")
    for prefixes, members in (
        (("MAV_TYPE_",), numbers.VehicleType.__members__),
        (("ESTIMATOR_",), numbers.EstimatorFlag.__members__),
        (("MAV_STATE_",), numbers.SystemStatus.__members__),
        (sensor_prefixes, numbers.Sensor.__members__),
    ):
        for name, number in members.items():
            assert number in [getattr(mavlink, prefix + name, None) for prefix in prefixes], name
    for bit in range(32):
        entry = mavlink.enums["MAV_SYS_STATUS_SENSOR"][1 << bit]
        name = entry.name.removeprefix(sensor_prefixes[0]).removeprefix(sensor_prefixes[1]).replace("_", " ").lower()
        assert numbers.sensor_names(1 << bit) == ([] if name == "prearm check" else [name])
    assert {mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_AUTOPILOT_PX4} == set(numbers.Firmware)
    assert {mavlink.MAV_VTOL_STATE_UNDEFINED, mavlink.MAV_VTOL_STATE_MC} == set(numbers.VtolState)
    assert mavlink.EKF_CONST_POS_MODE == numbers.EstimatorFlag.CONST_POS_MODE
    assert mavlink.MAV_FRAME_LOCAL_NED == numbers.LOCAL_NED
