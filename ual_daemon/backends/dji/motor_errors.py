"""Why DJI's flight controller does not start the motors, in words.

The numbers are those of DJI's Onboard SDK, ``ErrorCode::CommonACK::MOTOR_FAIL_*`` in ``dji_error.cpp``; the Payload SDK
reports the same ones.
"""

from __future__ import annotations

from collections.abc import Mapping

_WORDS: Mapping[int, str] = {
    1: "the compass is disturbed, not calibrated or broken",
    2: "it is connected to DJI Assistant by USB",
    3: "it is locked: set its parameters again after the upgrade",
    5: "an inertial sensor needs its calibration",
    6: "an inertial sensor has a wrong serial number",
    7: "an inertial sensor is not warm yet",
    8: "the compass is being calibrated",
    9: "an inertial sensor has no attitude",
    10: "no GPS in novice mode",
    11: "a cell of the battery is broken",
    12: "the battery does not answer",
    13: "the battery's voltage is too low",
    14: "the battery is below the user's limit for landing",
    15: "the main battery's voltage is too low",
    16: "the battery's temperature and voltage are too low",
    17: "the battery is only enough for a landing",
    18: "the battery is not ready",
    19: "it may be running the simulator",
    20: "its landing gear is packed",
    21: "it is tilted too far",
    22: "it is not activated: activate it with DJI's program",
    23: "it is in a no-fly zone",
    24: "the bias of an inertial sensor is too large",
    25: "a speed controller has an error",
    26: "an inertial sensor is starting",
    27: "its system is being upgraded",
    28: "the simulator has run: switch it off and on",
    29: "an inertial sensor is being calibrated",
    30: "it is tilted too far for a take-off",
    41: "its serial number is wrong",
    45: "GPS is disconnected",
    47: "its recorder has an error",
    61: "an inertial sensor is not connected",
    62: "the remote control is being calibrated",
    63: "the calibration of the remote control is out of range",
    64: "the calibration of the remote control was not finished",
    65: "the sticks of the remote control have no centre",
    66: "the channels of the remote control are mapped wrongly",
    67: "it has the firmware of another type of aircraft",
    68: "a module was found and not set up",
    74: "its navigation is abnormal",
    75: "its modules are not connected as they must be",
    76: "the remote control needs its calibration",
    78: "batteries are missing",
    79: "a battery is not an original one",
    80: "a battery does not answer",
    81: "the voltages of the batteries differ",
    82: "the voltages of the batteries differ",
    83: "the versions of its firmware do not fit together",
    84: "the gimbal's gyroscope is abnormal",
    88: "the gimbal's firmware is being upgraded",
    89: "the gimbal is out of control",
    93: "an inertial sensor was calibrated: switch it off and on",
    94: "its take-off went wrong",
    95: "a motor was blocked near the ground",
    96: "a motor turns unevenly on the ground",
    97: "a motor turns without a load: look at the propellers",
    98: "a motor did not start",
    99: "the automatic take-off went wrong",
    100: "it has rolled over",
    101: "the battery's firmware does not fit",
    102: "RTK is starting",
    103: "RTK did not start",
    110: "the motors run already",
    112: "a speed controller is being calibrated",
    114: "the gimbal is being calibrated",
    115: "its motors are disabled",
    116: "its height at the take-off is wrong",
    117: "a speed controller needs its upgrade",
    118: "the gyroscopes differ",
    119: "DJI's program does not allow it",
    120: "compass and inertial sensor point different ways",
    123: "a speed controller is too hot",
    124: "the battery has an error",
    125: "it has hit something",
    135: "the kill switch is on",
}


def motor_error_text(number: int) -> str:
    """Returns a human-readable motor start error; empty for 0, which is none."""
    if not number:
        return ""
    text = _WORDS.get(number)
    return f"motor start error {number}: {text}" if text else f"motor start error {number}"
