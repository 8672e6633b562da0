"""Tests that prove again what another one proves. `make test` leaves them out, `make test-all` runs them.

The rules stand here alone: no test is marked by hand.
"""

from __future__ import annotations

import dis
from functools import cache
from types import CodeType
from typing import Any

import pytest

from ual.conformance import Check

PROGRAMS = {
    "tests/campaign/test_flights.py": "whole flights among faults: the judge, and each fault, have tests of their own",
    "tests/deploy/test_container.py::test_it_flies": "the daemon without rights; `.ci/run` flies it",
    "tests/deploy/test_container.py::test_the_image_flies": "the same as a container",
    "tests/ual_daemon/backends/mavlink/test_autopilot_daemons.py::test_three": "a team, with one daemon over UDP each",
    "tests/test_contract.py::test_what_is_derived_is_up_to_date": "`make proto-check`, which `.ci/run` runs",
    "tests/examples/": "what users write, over a UAV whose parts are all tested",
    "tests/test_distributions.py": "the wheels",
    "tests/test_installation.py": "the commands of `make install`",
}
"""Whole programs of what is tested in parts, by the beginning of their path, and why they only repeat it."""

# --- Conformance: once per thing that can differ ----------------------------------------------------------------------

WHOLE = {
    "tests/ual/test_conformance.py": ("over_class", "over_tcp"),
    "tests/ual_daemon/backends/mavlink/test_autopilot_conformance.py": ("px4",),
}
"""Files in which all checks run: on the light UAV, both ways in, and over one autopilot."""
_ABOVE_BACKENDS = {"dry_runs", "missions", "paths", "refusals", "tasks"}
"""The checks, by module, of what the daemon does above all backends: over another backend it is the same code."""
_OF_TRAJECTORIES = {
    "keeps_the_heading",
    "turns_by_the_smaller_angle",
    "goes_to_a_waypoint_ahead",
    "goes_to_a_waypoint_in_map",
    "stops_at_each_waypoint_of_a_path",
    "rounds_the_corners_of_a_path",
}
"""The same among those that fly: a backend is given the setpoints of a trajectory, whatever its shape."""
_OF_THE_WIRE = {
    "says_who_it_is",
    "telemetry_flows",
    "bad_frames_are_refused",
    "takes_off",
    "holds_a_pose_reference",
    "a_handle_reports_its_task",
    "lands",
}
"""Calls of each kind: another transport carries all others alike."""
_OF_ANOTHER_VEHICLE = {
    *_OF_THE_WIRE,
    "a_velocity_of_the_body_turns_with_it",
    "arms_and_disarms",
    "flies_a_velocity_and_stops_without",
}
"""Checks that another vehicle of a backend flies beside its own and its pilot's: each kind of setpoint and command."""

# --- Faults -----------------------------------------------------------------------------------------------------------

SAME_BACKEND = {"ardupilot", "mavros ardupilot", "dji osdk", "hover"}
"""Vehicles of the fault flights whose backend flies another one there, or is an example.

A fault is shown at all its moments over the first vehicle of a test, and at the first moment over the others.
"""

# --- The second autopilot ---------------------------------------------------------------------------------------------

_MAVLINK = "tests/ual_daemon/backends/mavlink/test_autopilot_"
BOTH_ALIKE = (
    *(f"{_MAVLINK}{name}.py" for name in ("corrections", "daemons", "flights", "floor", "logs", "missions")),
    *(f"{_MAVLINK}{name}.py" for name in ("public_plans", "settings", "small", "velocities")),
    "tests/ual_daemon/backends/mavros/",
    "tests/ual_tools/rtcm/",
)
"""Files in which two autopilots fly the same code of UAL: one of them does in `make test`."""
WHERE_ASKED = (_MAVLINK,)
"""Folders in which both fly if the test itself asks which it is, and then at the first of several moments."""
_NAMES = {"ArduPilot", "Px4", "ardupilot", "px4", "kind"}
"""Names by which a test asks."""

# --- Series that cross ------------------------------------------------------------------------------------------------

CROSSED = (
    "tests/ual_daemon/backends/crazyflie/test_crazyflie_",
    "tests/ual_daemon/backends/dji/test_dji_descent.py",
    "tests/ual_daemon/backends/dji/test_dji_take_off.py",
    "tests/ual_daemon/flight/policy/test_velocity_rule.py",
    "tests/ual_daemon/flight/test_following_recorded.py",
    "tests/ual_daemon/tracker/test_tracker.py",
    "tests/ual_daemon/vehicle/test_changing_world.py",
    "tests/ual_daemon/vehicle/test_pause.py",
    _MAVLINK,
)
"""Flights and property tests in which several series of values cross: `make test` has each value of each series beside
the first values of the others, and one seed of noise. A value that is special is special there, too.
"""


def repeats(item: Any) -> bool:
    """Returns whether another test fails where this one does."""
    path = item.nodeid.partition("::")[0]
    if item.nodeid.startswith(tuple(PROGRAMS)):
        return True
    parameters: dict[str, Any] = item.callspec.params if hasattr(item, "callspec") else {}
    if not parameters or path.startswith("tests/sitl/"):
        return False
    check = parameters.get("check")
    if isinstance(check, Check):
        return _is_the_same_here(check, path, item)
    others = {name for name in parameters if not _is_first(item, name)}
    if path.startswith(CROSSED) and ("seed" in others or _count_series(item, others) > 1):
        return True
    if "craft" in others:
        return parameters["craft"] in SAME_BACKEND or len(others) > 1
    second = {name for name in others if _is_ardupilot(parameters[name])}
    if not second or path.startswith(BOTH_ALIKE):
        return bool(second)
    return path.startswith(WHERE_ASKED) and (others > second or not asks_which(item.function.__code__))


def _count_series(item: Any, names: set[str]) -> int:
    """Returns in how many series parameters stand: several names of one mark change together."""
    marks = [set(_names_of(mark)) & names for mark in item.iter_markers("parametrize")]
    together = [each for each in marks if each]
    return len(together) + len(names.difference(*together))


def _names_of(mark: Any) -> list[str]:
    return [each.strip() for each in mark.args[0].split(",")] if isinstance(mark.args[0], str) else list(mark.args[0])


def _is_ardupilot(value: object) -> bool:
    name = value[0] if isinstance(value, tuple) and value else value
    return isinstance(name, str) and name == "ardupilot"


def _is_first(item: Any, name: str) -> bool:
    """Returns whether a parameter has the first of its values. The indices of pytest count all tests of a function."""
    value = item.callspec.params[name]
    for mark in item.iter_markers("parametrize"):
        names = _names_of(mark)
        if name in names:
            first = _plain(next(iter(mark.args[1])), is_one=len(names) == 1)
            return first[names.index(name)] is value
    params = item._fixtureinfo.name2fixturedefs[name][-1].params
    return not params or _plain(params[0], is_one=True)[0] is value


def _plain(values: Any, *, is_one: bool) -> Any:
    """Returns the values of one set of parameters, which `pytest.param` may have made."""
    if isinstance(values, type(pytest.param())):
        return values.values
    return (values,) if is_one else values


@cache
def asks_which(code: CodeType) -> bool:
    """Returns whether a function, or one within it, reads a name or a text that tells the autopilots apart."""
    inner = [each for each in code.co_consts if isinstance(each, CodeType)]
    read = {each.argval for each in dis.get_instructions(code) if not each.opname.startswith("STORE")}
    return any(isinstance(each, str) and each in _NAMES for each in read) or any(map(asks_which, inner))


def _is_the_same_here(check: Check, path: str, item: Any) -> bool:
    if any(f"[{way}-" in item.name or f"-{way}]" in item.name for way in WHOLE.get(path, ())):
        return False
    if path == "tests/ual/test_conformance.py":
        return check.name not in _OF_THE_WIRE
    room = check.run.__module__.rpartition(".")[2]
    if not all(_is_first(item, name) for name in item.callspec.params if name != "check"):
        return not room.startswith(("own_", "piloted")) and check.name not in _OF_ANOTHER_VEHICLE
    return room in _ABOVE_BACKENDS or check.name in _OF_TRAJECTORIES
