"""A setpoint and a sample of telemetry are no more work than `tests/work/limits.py` says, where they are most."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.backend_of import backend_of
from tests.waiting import until, until_state
from tests.work import limits
from tests.work.counting import Work, calls_of_samples, counted, least, usual
from tests.work.flights import BACKENDS, flying, narrow
from tests.work.served import Served, served
from ual.errors import LinkLostError, WrongStateError
from ual.geometry import Twist, Vector3
from ual.recording.recorder import SteadyUtc
from ual.types import State
from ual_daemon import UAL

COUNT = 30
BLOCKS_EVERY = 9
"""Blocks are counted in each ninth, to and fro: the least of them counts."""
SLOW = Vector3(0.3, 0.3, 0.0)
_AT_NS = 1_800_000_000_000_000_000


@pytest.fixture(params=BACKENDS)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def flight(name: str) -> Iterator[UAL]:
    with flying(name, narrow(name)) as uav:
        yield uav


def setpoints(uav: UAL) -> list[Work]:
    """A stream to and fro, each setpoint after a new position. It begins anew where a busy computer broke it off."""
    works: list[Work] = []
    while len(works) < COUNT:
        last = backend_of(uav).snapshot().motion.pose
        until(lambda last=last: backend_of(uav).snapshot().motion.pose is not last, "a position")  # type: ignore[misc]
        twist = Twist(SLOW if len(works) % 2 else -SLOW)
        try:
            has_blocks = len(works) % BLOCKS_EVERY == 0
            works.append(counted(lambda twist=twist: uav.set_velocity(twist), has_blocks=has_blocks))  # type: ignore[misc]
        except (LinkLostError, WrongStateError):  # it was not heard, because its thread did not run
            works.clear()
            until_state(uav, State.FLYING_AUTO)
    return works


def assert_within(works: list[Work], most: limits.Most) -> None:
    found = limits.Most(int(usual(works).calls), int(max(works).calls), int(least(works).blocks))
    assert all(each <= limit for each, limit in zip(found, most, strict=True)), f"{found}, and the limits are {most}"


def test_a_setpoint_is_no_more_work(flight: UAL, name: str) -> None:
    assert_within(setpoints(flight), limits.SETPOINTS[name])


def test_a_sample_is_no_more_work(flight: UAL, name: str) -> None:
    found = calls_of_samples(flight, COUNT, lambda: flight.set_velocity(Twist(SLOW)))
    assert found <= limits.SAMPLES[name], f"{found:.0f} calls, and the limit is {limits.SAMPLES[name]}"


# --- Behind the server ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", limits.SERVED_SETPOINTS)
def test_a_served_setpoint_is_no_more_work(case: str, tmp_path: Path) -> None:
    def fly(uav: Served) -> list[Work]:
        ready = uav.call if case.startswith("call") else uav.stream()
        works = []
        for number in range(COUNT):
            uav.step()
            works.append(counted(ready(SLOW if number % 2 else -SLOW), has_blocks=number % BLOCKS_EVERY == 0))
        return works

    assert_within(served(fly, tmp_path, has_all=case.endswith("everything")), limits.SERVED_SETPOINTS[case])


@pytest.mark.parametrize("case", limits.SERVED_SAMPLES)
def test_a_served_sample_is_no_more_work(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # By its own clock a recording asks several times a second for what is rare: on a busy computer at each step.
    monkeypatch.setattr(SteadyUtc, "now_ns", lambda _: _AT_NS)

    def fly(uav: Served) -> list[Work]:
        ready = uav.stream()
        works = []
        for number in range(COUNT):
            ready(SLOW)()
            works.append(counted(uav.step, has_blocks=number % BLOCKS_EVERY == 0))
        return works

    works = served(fly, tmp_path, has_all=case == "everything")
    # How often a thread that hears the samples must be woken depends on the computer: the least counts.
    assert_within([each._replace(calls=least(works).calls) for each in works], limits.SERVED_SAMPLES[case])
