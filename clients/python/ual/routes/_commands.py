"""Effect of a mission's commands on a flight: some can be left out, and some UAL cannot fly.

Numbers and names are those of MAV_CMD (MAVLink common.xml and ardupilotmega.xml).
"""

from __future__ import annotations

WAYPOINT, LOITER_UNLIMITED, LOITER_TIME, RETURN_TO_LAUNCH, LAND, TAKEOFF = 16, 17, 19, 20, 21, 22
DELAY, CONDITION_YAW, JUMP, CHANGE_SPEED, SET_ROI, ROI_NONE = 93, 115, 177, 178, 201, 197
CONDITION_DELAY, CONDITION_DISTANCE, JUMP_TO_TAG, NAV_ROI = 112, 114, 601, 80
_NAV_LAST = 95
"""Commands up to this number move the vehicle (MAV_CMD_NAV_LAST)."""


def _each(*parts: tuple[str, tuple[int, ...]]) -> dict[int, str]:
    return {command: text for text, commands in parts for command in commands}


HARMLESS = _each(
    (
        "camera and gimbal",
        (
            200,
            202,
            203,
            204,
            205,
            206,
            214,
            220,
            260,
            *range(530, 535),
            1000,
            1001,
            2000,
            2001,
            2003,
            *range(2500, 2512),
        ),
    ),
    ("servos, relays and payload", (181, 182, 183, 184, 187, 211, 216, 42600)),
    ("the autopilot's fence", (207,)),
    ("the autopilot's marks (a landing, a return path, a tag, a rally landing)", (188, 189, 190, 600)),
    ("the end of a region of interest", (ROI_NONE,)),
)
"""Commands whose absence changes nothing of where, when and how the UAV flies."""

NOT_FLOWN = _each(
    ("circles (loiter turns)", (18,)),
    ("a landing or take-off in a local frame", (23, 24)),
    ("following another vehicle", (25, 32)),
    ("a change of altitude at a place (loiter to altitude)", (30, 31)),
    ("a region of interest, which turns the nose", (NAV_ROI, 195, 196, SET_ROI)),
    ("a spline", (82,)),
    ("a VTOL's take-off, landing or transition", (84, 85, 3000)),
    ("the control by another computer", (92, 222)),
    ("the placement of a payload", (94,)),
    ("a change of altitude at a rate", (113, 186)),
    ("a change of the autopilot's mode", (176,)),
    ("a change of home, from which altitudes count", (179,)),
    ("a change of a parameter", (180, 218)),
    ("the end of the flight (termination, parachute, engine)", (185, 208, 223)),
    ("arming", (400,)),
    ("a jump to a tag", (JUMP_TO_TAG,)),
    ("a point of a fence or a rally point (it is no mission)", (5000, 5001, 5002, 5003, 5004, 5100)),
)
"""Names of commands that change the flight, and that a path cannot express."""


def is_moving(command: int) -> bool:
    """Returns whether a mission that has this command flies on."""
    return command <= _NAV_LAST or command in (JUMP, JUMP_TO_TAG)
