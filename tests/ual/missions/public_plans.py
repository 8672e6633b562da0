"""Plans that others have made and published, item by item in a form of our own.

The files themselves are not here: those of ArduPilot are under the GPL. Each has its origin, and its items with their
numbers as they stand in it; `Public.text` writes them in the format that the file has. What else is in a `.plan` (the
camera's footprint of a survey, altitudes for display) plays no part in the mission.
"""

from __future__ import annotations

import json
from typing import Any, NamedTuple

from tests.ual.routes.missions import ARDUPILOT, PX4

Params = tuple[float | None, ...]
Row = tuple[int, int, Params]
"""A MAV_CMD, its MAV_FRAME and its seven numbers."""
Place = tuple[float, float, float]
"""Latitude, longitude in degrees, height above home in metres."""
_NUMBERS = (0, 0, 0, None)
_ZEROS = (0, 0, 0, 0)


class Public(NamedTuple):
    """One plan.

    Attributes:
        name: A short name.
        origin: Its repository and path.
        licence: Of that repository.
        home: Where it is planned to take off.
        items: Its items; those of a survey are a list among them.
        firmware: For whose autopilot it was made (MAV_AUTOPILOT).
        way: The places that it leads to, in their order; worked out by hand from the items.
        is_plan: Whether the file is a `.plan`; else it has lines of waypoints.
        refusal: How the refusal begins; empty where it can be flown.

    """

    name: str
    origin: str
    licence: str
    home: Place
    items: tuple[Row | tuple[Row, ...], ...]
    firmware: int = PX4
    way: tuple[Place, ...] = ()
    is_plan: bool = True
    refusal: str = ""

    @property
    def text(self) -> str:
        """The mission in the format of the file."""
        return _plan(self) if self.is_plan else _rows(self)

    @property
    def file_name(self) -> str:
        """A name with the ending of the file."""
        return f"{self.name}.{'plan' if self.is_plan else 'txt'}"

    @property
    def take_off_m(self) -> float:
        """Height of its take-off, above home."""
        return float(self.items[0][2][6])  # type: ignore[arg-type,misc]  # each that is flown begins with a take-off

    @property
    def lands(self) -> bool:
        """Whether it ends with a landing or a return."""
        return self.items[-1][0] in (20, 21)


def _at(lat: float, lon: float, alt: float, command: int = 16, first: float = 0.0, frame: int = 3) -> Row:
    return command, frame, (first, *_NUMBERS[1:], lat, lon, alt)


def _of_ardupilot(lat: float, lon: float, alt: float, command: int = 16, frame: int = 3) -> Row:
    return command, frame, (*_ZEROS, lat, lon, alt)


def _do(command: int, *params: float | None, frame: int = 2) -> Row:
    return command, frame, (*params, *[0] * (7 - len(params)))


def _plan(public: Public) -> str:
    number = iter(range(1, 1000))

    def simple(row: Row) -> dict[str, Any]:
        command, frame, params = row
        numbered = {"doJumpId": next(number), "autoContinue": True, "type": "SimpleItem"}
        return {**numbered, "command": command, "frame": frame, "params": list(params)}

    def survey(rows: tuple[Row, ...]) -> dict[str, Any]:
        inner = {"version": 1, "Items": [simple(each) for each in rows]}
        return {"type": "ComplexItem", "complexItemType": "survey", "version": 9, "TransectStyleComplexItem": inner}

    items = [simple(each) if isinstance(each[0], int) else survey(each) for each in public.items]
    mission = {
        "version": 2,
        "firmwareType": public.firmware,
        "vehicleType": 2,
        "cruiseSpeed": 15,
        "hoverSpeed": 5,
        "plannedHomePosition": list(public.home),
        "items": items,
    }
    fence, rally = {"circles": [], "polygons": [], "version": 2}, {"points": [], "version": 2}
    document = {"fileType": "Plan", "version": 1, "groundStation": "QGroundControl", "mission": mission}
    return json.dumps({**document, "geoFence": fence, "rallyPoints": rally})


def _rows(public: Public) -> str:
    rows = [_of_ardupilot(*public.home, frame=0), *public.items]
    lines = [
        "\t".join(map(str, (number, int(number == 0), frame, command, *params, 1)))
        for number, (command, frame, params) in enumerate(rows)
    ]
    return "\n".join(["QGC WPL 110", *lines]) + "\n"


_PX4, _ARDUPILOT = "PX4/PX4-Autopilot", "ArduPilot/ardupilot"
_BSD, _GPL, _APACHE = "BSD-3-Clause", "GPL-3.0", "Apache-2.0"
_COPTER = f"{_ARDUPILOT} Tools/autotest/ArduCopter_Tests"
_CANBERRA = (-35.363262, 149.165237, 584.0)
_RTL = _do(20)

_BOX = (
    (47.39787292480469, 8.54559326171875, 10.0),
    (47.39787292480469, 8.545341491699219, 10.0),
    (47.39773941040039, 8.545336723327637, 10.0),
    (47.39773941040039, 8.5455904006958, 10.0),
)
_AVOID = (
    (47.396545599479346, 8.544490781870365, 20.0),
    (47.39635128979426, 8.53915466175144, 20.0),
    (47.39446602392638, 8.540564444881795, 20.0),
)
_SAMPLE = (
    (47.39777106, 8.5466122, 50.0),
    (47.39827377, 8.54660532, 50.0),
    (47.39827842, 8.54560824, 50.0),
)
_EXAMPLE = (
    (47.39822664479198, 8.545560383312846, 50.0),
    (47.398249311957585, 8.544924206259822, 50.0),
    (47.397741626132294, 8.544924213007533, 50.0),
)
_PYRAMIDS = (
    (29.97690345, 31.13300264, 50.0),
    (29.97715437, 31.13230527, 50.0),
    (29.97829748, 31.13269151, 50.0),
    (29.97797221, 31.13128603, 50.0),
    (29.97728448, 31.13107145, 50.0),
    (29.97694991386429, 31.13263786259614, 50.0),
    (29.97597408724931, 31.132434016983865, 50.0),
    (29.97537928, 31.13303483, 50.0),
    (29.97716367, 31.13395751, 50.0),
)
_SPEEDS = (
    (-35.362656, 149.165072, 20.0),
    (-35.360174, 149.167908, 14.0),
    (-35.363296, 149.169244, 18.0),
    (-35.364115, 149.165747, 20.0),
)

FLOWN = (
    Public(
        "px4_box",
        f"{_PX4} integrationtests/python_src/px4_it/mavros/missions/MC_mission_box.plan",
        _BSD,
        (47.397742, 8.545594, 488.0),
        (
            _at(47.39773941040039, 8.5455904006958, 5.0, 22),
            *(_at(*each) for each in _BOX),
            _at(47.39773941040039, 8.545591354370117, 0.0, 21),
        ),
        way=_BOX,
    ),
    Public(
        "px4_safe_landing",
        f"{_PX4} integrationtests/python_src/px4_it/mavros/missions/MC_safe_landing.plan",
        _BSD,
        (47.3977419, 8.5455941, 489.0),
        (
            _at(47.3977394, 8.5455942, 18.0, 22, 15.0),
            _at(47.3977394, 8.5456982, 18.0),
            _at(47.3977432, 8.545805, 18.0),
            _at(47.3977432, 8.545804, 0.0, 21),
        ),
        way=((47.3977394, 8.5456982, 18.0), (47.3977432, 8.545805, 18.0)),
    ),
    Public(
        "px4_geofence_avoid",
        f"{_PX4} test/mavsdk_tests/multicopter_mission_geofence_avoid.plan",
        _BSD,
        (47.3977444, 8.5455918, 489.338),
        (_at(47.3977508, 8.5456074, 20.0, 22), *(_at(*each) for each in _AVOID), _RTL),
        way=_AVOID,
    ),
    Public(
        "mavsdk_sample",
        "mavlink/MAVSDK cpp/src/mavsdk/plugins/mission_raw/test_plans/qgroundcontrol_sample.plan",
        _BSD,
        (47.3977507, 8.5456075, 488.931),
        (
            _at(47.3977507, 8.5456075, 50.0, 22, 15.0),
            _at(*_SAMPLE[0]),
            _do(2000, 0, 0, 1),
            _at(*_SAMPLE[1]),
            _at(*_SAMPLE[2]),
            _RTL,
        ),
        way=_SAMPLE,
    ),
    Public(
        "mavsdk_python_example",
        "mavlink/MAVSDK-Python examples/example-mission.plan",
        _BSD,
        (47.397742, 8.5455939, 488.787),
        (_at(47.397742, 8.5455939, 50.0, 22), *(_at(*each) for each in _EXAMPLE), _RTL),
        way=_EXAMPLE,
    ),
    Public(
        "ardupilot_pyramids",
        f"{_ARDUPILOT} libraries/SITL/examples/Webots/mission_pyramids.plan",
        _GPL,
        (29.976462, 31.1338234, 50.0),
        ((22, 3, (15, 0, 0, None, 0, 0, 50)), *(_at(*each) for each in _PYRAMIDS)),
        ARDUPILOT,
        way=_PYRAMIDS,
    ),
    Public(
        "ardupilot_change_speed",
        f"{_COPTER}/DO_CHANGE_SPEED/mission.txt",
        _GPL,
        _CANBERRA,
        (
            _of_ardupilot(0.0, 0.0, 20.0, 22),
            _do(178, 0, 4, frame=3),
            _of_ardupilot(*_SPEEDS[0]),
            _do(178, 1, 15, frame=0),
            _of_ardupilot(*_SPEEDS[1]),
            _do(178, 1, 10, frame=0),
            _of_ardupilot(*_SPEEDS[2]),
            _do(178, 1, 16, frame=0),
            _of_ardupilot(*_SPEEDS[3]),
            _do(20, frame=0),
        ),
        ARDUPILOT,
        way=_SPEEDS,
        is_plan=False,
    ),
    Public(
        "ardupilot_delay",
        f"{_COPTER}/NavDelay/copter_nav_delay.txt",
        _GPL,
        _CANBERRA,
        (
            _of_ardupilot(-35.362968, 149.165146, 20.0, 22),
            _of_ardupilot(-35.362881, 149.165222, 20.0),
            _do(93, 60, frame=0),
            _do(20, frame=0),
        ),
        ARDUPILOT,
        way=((-35.362881, 149.165222, 20.0),),
        is_plan=False,
    ),
    Public(
        "ardupilot_pause_continue",
        f"{_COPTER}/PAUSE_CONTINUE/copter_mission.txt",
        _GPL,
        _CANBERRA,
        (
            _of_ardupilot(-35.362881, 149.165222, 20.0, 22),
            _of_ardupilot(-35.364652, 149.163501, 0.0),
            _of_ardupilot(-35.365361, 149.163501, 0.0),
            _of_ardupilot(-35.365361, 149.163995, 40.0),
            _of_ardupilot(-35.365361, 149.164563, 20.0),
            _of_ardupilot(-35.364652, 149.164531, 20.0),
            _of_ardupilot(-35.364652, 149.163995, 20.0),
            _of_ardupilot(0.0, 0.0, 0.0),
            _do(20, frame=0),
        ),
        ARDUPILOT,
        way=(
            (-35.364652, 149.163501, 20.0),
            (-35.365361, 149.163501, 20.0),
            (-35.365361, 149.163995, 40.0),
            (-35.365361, 149.164563, 20.0),
            (-35.364652, 149.164531, 20.0),
            (-35.364652, 149.163995, 20.0),
            (-35.364652, 149.163995, 20.0),
        ),
        is_plan=False,
    ),
)

_TRANSECTS = (
    (47.397705960554916, 8.546339694155481),
    (47.39770596118868, 8.546206836516207),
    (47.39770596219769, 8.545744326765641),
    (47.39770596214361, 8.54561146912636),
    (47.397481131760195, 8.545631605677352),
    (47.39748113179102, 8.545764462749732),
    (47.3974811307771, 8.54620924114824),
    (47.39748113014056, 8.546342098220613),
)
_PHOTOS, _NO_PHOTOS = _do(206, 25, 0, 1), _do(206, 0, 0, 1)

REFUSED = (
    Public(
        "mavsdk_survey",
        "mavlink/MAVSDK .../mission_raw/test_plans/qgroundcontrol_sample_with_survey_wrong_version.plan",
        _BSD,
        (47.39801775617688, 8.545149580000002, 483.426),
        (
            (530, 2, (0, 2, None, None, None, None, None)),
            (
                _at(*_TRANSECTS[0], 50.0),
                _PHOTOS,
                _at(*_TRANSECTS[1], 50.0),
                _PHOTOS,
                *(_at(*each, 50.0) for each in _TRANSECTS[2:6]),
                _PHOTOS,
                *(_at(*each, 50.0) for each in _TRANSECTS[6:]),
                _NO_PHOTOS,
            ),
        ),
        refusal="item 1: it has camera and gimbal, which a mission of UAL has not (MAVLink command 530)",
    ),
    Public(
        "px4_package_delivery",
        f"{_PX4} test/mavsdk_tests/mission_plans/triangle_gripper_package_delivery.plan",
        _BSD,
        (47.398538996176875, 8.54554255, 483.379),
        (
            _at(47.39791045720388, 8.545593277092053, 5.0),
            _at(47.39775272773859, 8.545153480649049, 0.0, 21),
            _do(211),
            _at(47.39757902988248, 8.545586262687607, 10.0),
        ),
        refusal="item 3: it has servos, relays and payload, which a mission of UAL has not (MAVLink command 211)",
    ),
    Public(
        "dronekit_import_export",
        "dronekit/dronekit-python examples/mission_import_export/mpmission.txt",
        _APACHE,
        (-35.3605, 149.172363, 747.0),
        (
            _of_ardupilot(-35.359831, 149.166334, 100.0, 22),
            _of_ardupilot(-35.363489, 149.167213, 100.0),
            _of_ardupilot(-35.355491, 149.169595, 100.0),
            _of_ardupilot(-35.355071, 149.175839, 100.0),
            _of_ardupilot(-35.362666, 149.178715, 22222.0, 113),
            (115, 3, (2, 22, 1, 3, 0, 0, 0)),
            _of_ardupilot(0.0, 0.0, 0.0),
        ),
        ARDUPILOT,
        is_plan=False,
        refusal="line 7, item 5: it has a change of altitude at a rate, which a mission of UAL has not",
    ),
    Public(
        "ardupilot_circuit",
        f"{_ARDUPILOT} Tools/autotest/Generic_Missions/CMAC-copter-circuit.txt",
        _GPL,
        _CANBERRA,
        (
            _of_ardupilot(-35.363981, 149.165311, 20.0, 22),
            _of_ardupilot(-35.362513, 149.165103, 20.0),
            _of_ardupilot(-35.362533, 149.164246, 20.0),
            _of_ardupilot(-35.363981, 149.164417, 20.0),
            _of_ardupilot(-35.363981, 149.165311, 20.0),
            _do(177, 2, -1, frame=0),
        ),
        ARDUPILOT,
        is_plan=False,
        refusal="line 8, item 6: it repeats without an end, or never: give a number of times (parameter 2)",
    ),
)
