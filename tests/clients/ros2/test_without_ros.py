"""The node's own parts, with fakes in the place of ROS."""

from __future__ import annotations

import asyncio
import importlib
import threading
from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from unittest.mock import MagicMock
from xml.etree import ElementTree as ET

import pytest

import ual
from tests.clients.ros2.record import modules_of_ros, without_ros
from tests.waiting import until_async
from ual.cameras import CameraAbility, CameraInfo, ImageKind
from ual_ros2 import health
from ual_ros2.settings import DEFAULTS, settings_of

PACKAGE = Path(__file__).parents[3] / "clients" / "ros2" / "ual_ros2"
LANDING = ual.Telemetry(ual.State.LANDING)


@pytest.fixture
def ros() -> Iterator[None]:
    with without_ros():
        yield


def part(name: str) -> ModuleType:
    """A module of the node, imported with the fakes."""
    return importlib.import_module(f"ual_ros2.{name}")


# --- What ROS installs with it ----------------------------------------------------------------------------------------


def test_each_package_that_is_imported_is_installed_with_it() -> None:
    manifest = ET.parse(PACKAGE / "package.xml")
    named = {each.text for each in manifest.getroot().iter("exec_depend")}
    assert {name.partition(".")[0] for name in modules_of_ros()} - named == set()


# --- Leases -----------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("ros")
def test_what_the_daemon_takes_without_a_lease_needs_none_of_the_node() -> None:
    """docs/how-to/access.md: reading, cameras, frames, poses from outside, the simulated world and its pilot."""
    table = part("services.service_table").ServiceTable(part("services.filling").Filling(), MagicMock(), None)
    commands = [*part("flights").SERVICES, *table.services(), *table.simulation()]
    free = {"start_photos", "stop_photos", "start_video", "stop_video", "take_photo", "add_frame", "set_external_pose"}
    reading = ("get_", "list_", "simulation/", "set_camera_", "plan_", "download_")
    wrong = [
        each.name for each in commands if each.needs_lease and (each.name in free or each.name.startswith(reading))
    ]
    assert wrong == []
    assert {"take_off", "set_parameter", "release", "upload_fence", "jump_to_item"} <= {
        each.name for each in commands if each.needs_lease
    }


# --- Goals ------------------------------------------------------------------------------------------------------------


class FakePilot:
    """Flies a goal until it is cancelled, and counts what is aborted."""

    has_safety_pilot = False
    newest: ual.Telemetry | None = LANDING

    def __init__(self) -> None:
        self.aborts_count = 0
        self.run: Any = None

    def begin_command(self, _: object, __: object) -> Any:
        async def begin() -> Mapping[str, object]:
            never: asyncio.Future[Mapping[str, object]] = asyncio.Future()
            return await never

        self.run = part("outcome").CommandRun(begin)
        return self.run

    async def abort(self) -> None:
        self.aborts_count += 1


def interface() -> Any:
    """The interface of one UAV, of whose daemon nothing was heard."""
    settings = settings_of({name: default for name, (default, _) in DEFAULTS.items()})
    shared = SimpleNamespace(
        node=MagicMock(),
        loop=asyncio.get_running_loop(),
        settings=settings,
        time=MagicMock(),
        tf=MagicMock(),
        listener=MagicMock(),
    )
    shared.node.count_publishers.return_value = 1
    return part("interface").UavInterface(shared, "uav_1", "")


async def run_ready() -> None:
    """Runs all that is ready to run."""
    for _ in range(20):
        await asyncio.sleep(0)


async def _cancelled(action_name: str, **goal: object) -> tuple[FakePilot, bool]:
    """Cancels a goal that flies. Returns its pilot, and whether it has ended by that."""
    loop, pilot = asyncio.get_running_loop(), FakePilot()
    [action] = [each for each in part("flights").ACTIONS if each.name == action_name]
    goals = part("goals").ActionGoals(MagicMock(), loop, f"/uav_1/ual/{action_name}", action, pilot, 1000.0)
    handle = MagicMock(goal_id=SimpleNamespace(uuid=bytes(16)), request=SimpleNamespace(**goal))
    flying = loop.create_task(goals._fly(handle))
    await run_ready()
    goals._on_cancel(handle)
    await run_ready()
    has_ended = flying.done()
    flying.cancel()
    return pilot, has_ended


@pytest.mark.usefixtures("ros")
@pytest.mark.parametrize("name", ["take_off", "land", "go_to_waypoint"])
def test_a_cancel_of_a_goal_that_only_asks_aborts_nothing(name: str) -> None:
    pilot, has_ended = asyncio.run(_cancelled(name, dry_run=True))
    assert (pilot.aborts_count, has_ended) == (0, True)


@pytest.mark.usefixtures("ros")
def test_a_cancel_of_a_landing_aborts_it_where_no_safety_pilot_is() -> None:
    pilot, _ = asyncio.run(_cancelled("land", dry_run=False))
    assert pilot.aborts_count == 1


@pytest.mark.usefixtures("ros")
def test_a_goal_of_which_the_node_cannot_tell_is_not_executed_on() -> None:
    """rclpy ends such a goal as aborted."""

    def fail(_: object, __: object) -> bool:
        raise ValueError("a mistake")

    async def executed() -> Any:
        pilot = FakePilot()
        action = replace(part("flights").ACTIONS[-1], is_task=False, also=fail)
        goals = part("goals").ActionGoals(MagicMock(), asyncio.get_running_loop(), "", action, pilot, 1000.0)
        with pytest.raises(ValueError, match="a mistake"):
            await goals._fly(MagicMock(goal_id=SimpleNamespace(uuid=bytes(16))))
        return await asyncio.wait_for(pilot.run.task, 5.0)

    assert asyncio.run(executed()).message == "cancelled: the node failed"


class WatchedPilot(FakePilot):
    """Counts how often its newest sample was looked at. There is none at first."""

    def __init__(self) -> None:
        super().__init__()
        self.looked_count = 0
        self._sample: ual.Telemetry | None = None

    @property
    def newest(self) -> ual.Telemetry | None:
        self.looked_count += 1
        return self._sample

    @newest.setter
    def newest(self, sample: ual.Telemetry | None) -> None:
        self._sample = sample


def telling(stamp_s: float, task_id: str) -> ual.Telemetry:
    """A sample of a task that runs."""
    task = ual.TaskInfo(task_id, ual.TaskKind.GO_TO_WAYPOINT, ual.TaskStatus.RUNNING)
    return ual.Telemetry(ual.State.FLYING_AUTO, stamp_s=stamp_s, task=task)


@pytest.mark.usefixtures("ros")
def test_a_goal_takes_no_task_as_its_own_that_ran_before_it_was_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a silence the node does not know which one that is. What was told in it may come later."""
    filled: list[str] = []
    monkeypatch.setattr(part("values"), "fill_feedback", lambda _, __, task: filled.append(task.id))

    async def executed() -> None:
        pilot = WatchedPilot()
        [action] = [each for each in part("flights").ACTIONS if each.name == "go_to_waypoint"]
        goals = part("goals").ActionGoals(MagicMock(), asyncio.get_running_loop(), "", action, pilot, 1e6)
        handle = MagicMock(goal_id=SimpleNamespace(uuid=bytes(16)), request=SimpleNamespace(dry_run=False))
        flying = asyncio.create_task(goals._fly(handle))

        async def reported(sample: ual.Telemetry) -> None:
            pilot.newest, looked_count = sample, pilot.looked_count
            await until_async(lambda: pilot.looked_count > looked_count + 1)

        await reported(telling(9.0, "of another program"))  # it is not sent yet
        pilot.run.before = part("outcome").Before(10.0, "before")
        await reported(telling(9.5, "even earlier"))
        await reported(telling(10.5, "before"))
        assert filled == []
        await reported(telling(11.0, "own"))
        await until_async(lambda: filled)
        pilot.run.cancel("the node ends")
        await flying

    asyncio.run(executed())
    assert set(filled) == {"own"}


@pytest.mark.usefixtures("ros")
@pytest.mark.parametrize("is_dry_run", [False, True])
def test_the_daemon_is_queried_what_runs_just_before_a_goal_is_sent(is_dry_run: bool) -> None:
    steps: list[str] = []

    async def telemetry() -> ual.Telemetry:
        steps.append("asked")
        return telling(7.0, "before")

    async def provide(_: object) -> None:
        steps.append("frames")

    async def call(_: object, __: object) -> None:
        steps.append("sent")

    async def before() -> Any:
        uav = interface()
        uav._is_active, uav._frames.provide = True, provide
        uav._pulse = part("lateness").ProgramPulse(lambda: 0.0)  # a busy computer does not stand still here
        uav._contact = part("contact").DaemonContact(telemetry, 30.0, lambda: 0.0)  # it is heard
        action = part("command").ActionCommand("go_to_waypoint", None, call)
        run = uav.begin_command(action, SimpleNamespace(dry_run=is_dry_run))
        assert (await run.task).is_success
        await uav.close()
        return run.before

    found = asyncio.run(before())
    if is_dry_run:
        assert (found, steps) == (None, ["frames", "sent"])
    else:
        assert (found, steps) == (part("outcome").Before(7.0, "before"), ["frames", "asked", "sent"])


# --- Services ---------------------------------------------------------------------------------------------------------


class EagerNode:
    """A node whose executor serves a request while the service is still being made, as on another thread it may."""

    def __init__(self) -> None:
        self.answers: list[object] = []
        self.service = SimpleNamespace(send_response=lambda response, _: self.answers.append(response))

    def create_service(self, _: object, __: str, callback: Any) -> SimpleNamespace:
        self.serving = threading.Thread(target=self._serve, args=(callback,))
        self.serving.start()
        self.serving.join(0.05)
        return self.service

    def _serve(self, callback: Any) -> None:
        response = callback("a request", None)
        self.service.send_response(response, SimpleNamespace(source_timestamp=0))


@pytest.mark.usefixtures("ros")
def test_a_request_that_comes_while_a_service_is_made_is_answered() -> None:
    node, future = EagerNode(), Future[str]()
    future.set_result("an answer")
    part("late_service").LateService(node, None, "/uav_1/ual/simulation/step", lambda _, __: future)
    node.serving.join()
    assert node.answers == ["an answer"]


# --- Mistakes in the node ---------------------------------------------------------------------------------------------


class BrokenCameras:
    """Cameras of which the node makes a mistake."""

    async def get_all(self) -> list[CameraInfo]:
        abilities, kinds = frozenset({CameraAbility.IMAGE}), frozenset({ImageKind.COLOUR})
        return [CameraInfo(0, "c", abilities, image_kinds=kinds)]

    def __getitem__(self, number: int) -> Any:
        async def image(**_: object) -> None:
            raise ValueError("a mistake")

        return SimpleNamespace(image=image)


@pytest.mark.usefixtures("ros")
def test_a_camera_that_ends_by_a_mistake_ends_loudly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(part("cameras"), "LOOK_S", 0.001)
    uav = SimpleNamespace(cameras=BrokenCameras())
    following = part("cameras").RosCameras(MagicMock(), uav, "uav_1", MagicMock(), MagicMock(), 1000.0)

    async def follow() -> None:
        await asyncio.wait_for(following.follow(), 5.0)

    with pytest.raises(ValueError, match="a mistake"):
        asyncio.run(follow())


@pytest.mark.usefixtures("ros")
def test_a_part_that_ended_by_a_mistake_is_reported_until_the_node_is_started_again() -> None:
    async def reported() -> health.Status:
        loop, uav = asyncio.get_running_loop(), interface()
        work = loop.create_task(_mistaken())
        await asyncio.wait((work,))
        uav._on_work_ended(work)
        uav._note_connection()
        await uav.close()
        return health.of(ual.Telemetry(ual.State.FLYING_AUTO), uav._said)

    status = asyncio.run(reported())
    assert (status.level, status.message) == (health.ERROR, "the node failed, start it again: ValueError('a mistake')")


async def _mistaken() -> None:
    raise ValueError("a mistake")
