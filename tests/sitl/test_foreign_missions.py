"""Another station's mission that replaces ours: our task ends within a second, and names it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from time import monotonic

import pytest

from tests.sitl.doing import HEIGHT_M, Doing, mission_of, take_off, waypoints
from tests.sitl.flights import PATIENCE_S, Flight
from tests.sitl.simulators import Simulator
from tests.sitl.transmitter import Transmitter
from tests.sitl.truth import Truth
from tests.sitl.wiretap import Wiretap
from ual.errors import TaskAbortedError, UalError
from ual_daemon import UAL

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]

TOLD_S = 1.0
PASSED_M = 3.5
OTHER_ID = 192


def foreign(flight: Flight) -> list[tuple[float, float, float]]:
    """Returns waypoints to the south, as many as our mission does not have."""
    (away,) = waypoints(flight, -0.5)
    return [(away.latitude_deg, away.longitude_deg, HEIGHT_M)] * 3


def is_named(error: UalError | None) -> bool:
    """Returns whether it is the end of a task by another station's mission."""
    return isinstance(error, TaskAbortedError) and "mission" in str(error)


@pytest.mark.parametrize("after_s", [2.0, 0.0, 0.3])
def test_a_mission_that_another_station_replaces_ends_within_a_second(
    flight: Flight, pilot: Transmitter, after_s: float
) -> None:
    doing = Doing()
    take_off(flight, doing, "mission")
    others = foreign(flight)
    doing.begin(mission_of(flight, [*waypoints(flight, 1, 0)]))
    threading.Event().wait(after_s)  # what is tested is a time after the start
    assert pilot.upload_mission(others)
    replaced_s = monotonic()
    doing.join()
    assert doing.ended_s is not None
    print(f"{pilot.autopilot}: {doing.ended_s - replaced_s:.2f} s after the upload: {doing.error}")
    assert is_named(doing.error)
    assert doing.ended_s - replaced_s < TOLD_S


@pytest.fixture
def second(wiretap: Wiretap, url: str, simulator: Simulator) -> Iterator[UAL]:
    """Another daemon: PX4 has one link for both, ArduCopter a third."""
    is_px4 = simulator.autopilot == "PX4"
    second_url = wiretap.url if is_px4 else f"tcp://127.0.0.1:{int(url.rsplit(':', 1)[1]) + 3}"
    with UAL("mavlink", "uav_1", url=second_url, backend_settings={"component_id": OTHER_ID}) as second:
        yield second


@pytest.mark.parametrize("after_s", [0.0, 0.3])
def test_the_mission_of_another_daemon_is_never_reported_as_ours(
    flight: Flight, uav: UAL, second: UAL, truth: Truth, after_s: float
) -> None:
    """Its upload is refused where it knows that ours flies. One that came before the start is what is started."""
    doing, other, begun = Doing(), Doing(), threading.Event()
    take_off(flight, doing, "mission")
    flight.wait_for(second.is_ready, "a state of the second")
    goals = {"ours": waypoints(flight, 0.5, 0), "theirs": waypoints(flight, -0.5, 0)}
    passed_m = dict.fromkeys(goals, 1e3)
    uav.mission.upload(goals["ours"])

    def upload() -> None:
        begun.wait(PATIENCE_S)
        threading.Event().wait(after_s)  # as above
        second.mission.upload(goals["theirs"])

    other.begin(upload)
    begun.set()
    task = uav.task(uav.mission.start().id)
    doing.begin(lambda: task.wait(PATIENCE_S))

    def is_over() -> bool:
        for whose, (goal, _) in goals.items():
            distance_m = truth.distance_m((goal.latitude_deg, goal.longitude_deg))
            passed_m[whose] = min(passed_m[whose], distance_m)
        return doing.ended_s is not None

    flight.wait_for(is_over, "the end of the mission")
    other.join()
    print(f"ours: {doing.error}; theirs: {other.error}; passed {passed_m}")
    if doing.error is None:
        assert passed_m["ours" if other.error else "theirs"] < PASSED_M
    else:
        assert is_named(doing.error)
