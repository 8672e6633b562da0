"""Which tests prove again what another one proves. `make test` leaves them out, `make test-all` runs them.

The rules stand here alone: no test is marked by hand.
"""

from __future__ import annotations

from typing import Any

from ual.conformance import Check

PROGRAMS = {
    "tests/campaign/test_flights.py": "whole flights among faults: the judge, and each fault, have tests of their own",
    "tests/deploy/test_container.py::test_it_flies": "the daemon without rights; `.ci/run` flies it",
    "tests/deploy/test_container.py::test_the_image_flies": "the same as a container",
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
"""Where all checks run: on the light UAV, both ways in, and over one autopilot."""
_ABOVE_BACKENDS = {"dry_runs", "missions", "paths", "refusals", "tasks"}
"""The checks, by module, of what the daemon does above all backends: over another backend it is the same code."""
_OF_TRAJECTORIES = {
    "keeps_the_heading",
    "turns_the_shortest_way",
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

# --- Faults -----------------------------------------------------------------------------------------------------------

SAME_BACKEND = {"ardupilot", "mavros ardupilot", "dji osdk", "hover"}
"""Vehicles of the fault flights whose backend flies another one there, or is an example.

A fault is shown at all its moments over the first vehicle of a test, and at the first moment over the others.
"""


_MAVLINK = "tests/ual_daemon/backends/mavlink/test_autopilot_"
BOTH_ALIKE = (
    *(f"{_MAVLINK}{name}.py" for name in ("corrections", "daemons", "flights", "floor", "logs", "missions")),
    *(f"{_MAVLINK}{name}.py" for name in ("public_plans", "settings", "small", "velocities")),
    "tests/ual_daemon/backends/mavros/",
    "tests/ual_tools/rtcm/",
)
"""Where two autopilots fly the same code of UAL: one of them does in `make test`."""


def repeats(item: Any) -> bool:
    """Whether another test fails where this one does."""
    path = item.nodeid.partition("::")[0]
    if item.nodeid.startswith(tuple(PROGRAMS)):
        return True
    parameters: dict[str, Any] = item.callspec.params if hasattr(item, "callspec") else {}
    if not parameters:
        return False
    if item.callspec.indices.get("craft"):
        is_another_moment = any(index for name, index in item.callspec.indices.items() if name != "craft")
        return is_another_moment or parameters["craft"] in SAME_BACKEND
    check = parameters.get("check")
    if check is None and path.startswith(BOTH_ALIKE):
        return any(parameters[name] == "ardupilot" and index for name, index in item.callspec.indices.items())
    return isinstance(check, Check) and not path.startswith("tests/sitl/") and _is_the_same_here(check, path, item.name)


def _is_the_same_here(check: Check, path: str, name: str) -> bool:
    if any(f"[{way}-" in name or f"-{way}]" in name for way in WHOLE.get(path, ())):
        return False
    if path == "tests/ual/test_conformance.py":
        return check.name not in _OF_THE_WIRE
    return check.run.__module__.rpartition(".")[2] in _ABOVE_BACKENDS or check.name in _OF_TRAJECTORIES
