"""Several UAVs by one call: `ual.Team` and `ual.aio.Team`, over real daemons of light UAVs."""

from __future__ import annotations

import asyncio
import inspect
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

import ual
import ual.interface
from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon
from tools.contract.compiled import compiled
from tools.contract.parts import parts
from ual.types import State, TaskStatus

TEAM = ("uav_1", "uav_2", "uav_3")


@pytest.fixture
def fleet(start_daemon: StartDaemon) -> DaemonProcess:
    """Three armed light UAVs in one process."""
    daemon = start_daemon("--fleet", "3", "--auto-arm", "--set", "light.speed_factor=10")
    for name in TEAM:
        daemon.wait_for("state", ns=name, new="LANDED_ARMED")
    return daemon


@pytest.fixture
def team(fleet: DaemonProcess) -> Iterator[ual.Team]:
    del fleet
    with ual.Team(TEAM) as team:
        yield team


NOT_OF_A_TEAM = {
    "ns",
    "simulation",
    "subscribe",
    "set_external_pose",
    "task",
    "extension",
    *(each.module for each in parts(compiled()) if not each.bound),
}
"""Members that make sense for one UAV only: `team["uav_1"]` is one."""


@pytest.mark.parametrize(("team", "uav"), [(ual.Team, ual.interface.Uav), (ual.aio.Team, ual.aio.Uav)])
def test_a_team_has_the_members_of_a_uav(team: type, uav: type) -> None:
    """So a new member of a UAV is not forgotten."""
    missing = {name for name in dir(uav) if not name.startswith("_") and not hasattr(team, name)}
    assert missing - {"address"} == NOT_OF_A_TEAM


@pytest.mark.parametrize("team", [ual.Team, ual.aio.Team])
def test_a_member_has_the_signature_of_a_uavs_and_results_by_name(team: Any) -> None:
    assert str(inspect.signature(team.pose)) == "(self) -> 'dict[str, PoseStamped]'"
    signature = "(self, *, force: 'bool' = False, timeout_s: 'float | None' = None) -> 'None'"
    assert str(inspect.signature(team.recover_from_manual)) == signature
    first, _, rest = inspect.cleandoc(team.pause.__doc__).partition("\n\n")
    assert first == "Brakes on the way of the running task and holds there. Allowed in FLYING_AUTO. Returns at once."
    assert rest == "See `ual.interface.Uav.pause`."
    assert team.pause.__name__ == "pause"


def test_one_call_flies_all_and_the_results_have_their_names(team: ual.Team) -> None:
    tasks = team.take_off(3.0)
    assert [(name, task.info().status) for name, task in tasks.items()] == [
        (name, TaskStatus.SUCCEEDED) for name in TEAM
    ]
    assert team.state() == dict.fromkeys(TEAM, State.FLYING_AUTO)
    assert {name: round(pose.pose.position.z) for name, pose in team.pose().items()} == dict.fromkeys(TEAM, 3)


def test_each_may_have_a_goal_of_its_own(team: ual.Team) -> None:
    team.take_off(3.0)
    goals = {name: ual.Pose.at(float(i), 0.0, 3.0) for i, name in enumerate(TEAM)}
    team.each(lambda name, uav: uav.go_to_waypoint(goals[name]))
    assert [round(pose.pose.position.x) for pose in team.pose().values()] == [0, 1, 2]


def test_who_refuses_is_named_and_the_others_fly(team: ual.Team) -> None:
    team["uav_2"].take_off(3.0)
    with pytest.raises(ual.TeamError, match="uav_2: WRONG_STATE: take_off") as caught:
        team.take_off(3.0)
    assert list(caught.value.errors) == ["uav_2"]
    assert isinstance(caught.value.errors["uav_2"], ual.WrongStateError)
    assert list(caught.value.results) == ["uav_1", "uav_3"]
    assert team.state() == dict.fromkeys(TEAM, State.FLYING_AUTO)


def test_where_one_cannot_be_reached_none_moves(fleet: DaemonProcess) -> None:
    del fleet
    with ual.Team([*TEAM, "uav_9"]) as team:
        with pytest.raises(ual.TeamError, match="uav_9: DAEMON_UNREACHABLE") as caught:
            team.take_off(3.0)
        assert list(caught.value.errors) == ["uav_9"]
        assert [team[name].state() for name in TEAM] == [State.LANDED_ARMED] * 3


@pytest.mark.parametrize(
    "end",
    [
        pytest.param(lambda team: team.land(), id="land"),
        pytest.param(lambda team: team.return_to_launch(), id="rtl"),
    ],
)
def test_what_ends_a_flight_ends_it_for_all_that_can_be_reached(
    fleet: DaemonProcess, end: Callable[[ual.Team], object]
) -> None:
    del fleet
    with ual.Team(TEAM) as team:
        team.take_off(3.0)
    with ual.Team([*TEAM, "uav_9"]) as team:
        with pytest.raises(ual.TeamError, match="uav_9: DAEMON_UNREACHABLE") as caught:
            end(team)
        assert sorted(caught.value.results) == list(TEAM)
        assert {team[name].state() for name in TEAM} <= {State.LANDED_ARMED, State.LANDED_DISARMED}


def test_tasks_can_be_watched_paused_and_cancelled_one_by_one(team: ual.Team) -> None:
    team.take_off(3.0)
    team[TEAM[0]].simulation.set_speed_factor(0.1)  # of all: the go-to lasts
    tasks = team.go_to_waypoint(ual.Pose.at(5.0, 0.0, 3.0), blocking=False)
    first, second, third = tasks.values()
    first.cancel()
    second.pause()
    assert second.info().is_paused
    second.resume()
    assert not third.done()
    team[TEAM[0]].simulation.set_speed_factor(10.0)
    last = list(third.watch(rate_hz=50.0))[-1]
    assert (last.status, first.info().status) == (TaskStatus.SUCCEEDED, TaskStatus.ABORTED)
    assert second.wait(LIMIT_S).status is TaskStatus.SUCCEEDED


def test_an_abort_stops_all(team: ual.Team) -> None:
    team.take_off(3.0)
    tasks = team.go_to_waypoint(ual.Pose.at(1000.0, 0.0, 3.0), blocking=False)
    team.abort()
    assert [task.info().status for task in tasks.values()] == [TaskStatus.ABORTED] * 3


def test_a_dry_run_asks_all_and_moves_none(team: ual.Team) -> None:
    plans = team.dry_run.take_off(3.0)
    assert list(plans) == list(TEAM)
    assert team.state() == dict.fromkeys(TEAM, State.LANDED_ARMED)


def test_a_call_that_is_cancelled_is_cancelled_for_all(fleet: DaemonProcess) -> None:
    del fleet

    async def run() -> None:
        async with ual.aio.Team(TEAM) as team:
            await team.take_off(3.0)
            going = asyncio.create_task(team.go_to_waypoint(ual.Pose.at(500.0, 0.0, 3.0)))
            while any((await team.is_idle()).values()):
                pass
            going.cancel()
            with pytest.raises(asyncio.CancelledError):
                await going
            while not all((await team.is_idle()).values()):
                pass
            assert await team.state() == dict.fromkeys(TEAM, State.FLYING_AUTO)

    asyncio.run(asyncio.wait_for(run(), LIMIT_S))


def test_names_are_checked() -> None:
    for wrong in ([], ["uav_1", "uav_1"], "uav_1", [""]):
        with pytest.raises(ual.InvalidArgumentError):
            ual.Team(wrong)
    assert not [each for each in threading.enumerate() if each.name == "ual team"]


def test_a_closed_team_says_so(fleet: DaemonProcess) -> None:
    del fleet
    team = ual.Team(TEAM)
    team.close()
    team.close()
    with pytest.raises(ual.UalError, match="closed"):
        team.state()


def test_what_runs_while_the_team_is_closed_ends_and_its_caller_hears_it(fleet: DaemonProcess) -> None:
    del fleet
    team, has_begun = ual.Team(TEAM), threading.Event()

    async def wait_for_ever(_: str, uav: ual.aio.Uav) -> None:
        await uav.state()
        has_begun.set()
        await asyncio.Event().wait()

    with ThreadPoolExecutor() as pool:
        waiting = pool.submit(team.ask, wait_for_ever)
        assert has_begun.wait(LIMIT_S)
        team.close()
        with pytest.raises(ual.UalError, match="the team is closed"):
            waiting.result(LIMIT_S)


def test_a_team_that_would_wait_for_itself_says_so(team: ual.Team) -> None:
    async def ask(*_: object) -> object:
        return team.state()

    with pytest.raises(ual.TeamError, match=r"on its own event loop.*await those of the ual\.aio\.Uav"):
        team.ask(ask)


def test_what_each_is_passed_has_to_be_a_call_of_the_asyncio_uav(team: ual.Team) -> None:
    for no_call in (lambda name, _: team[name].state(), lambda *_: None):
        with pytest.raises(ual.InvalidArgumentError, match=r"is no coroutine: return a call of the ual\.aio\.Uav"):
            team.each(no_call)  # type: ignore[arg-type]
