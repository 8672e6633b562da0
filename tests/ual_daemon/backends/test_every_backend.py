"""Duties of every backend to the layers above, whichever autopilot it drives."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import LIMIT_S
from tests.simulators.airsim import Vehicle
from tests.simulators.airsim_server import AirsimServer
from tests.simulators.lockstep import LockstepPx4
from tests.simulators.lockstep_crazyflie import LockstepCrazyflie
from tests.simulators.lockstep_dji import LockstepPsdk
from tests.simulators.lockstep_mavros import LockstepMavros
from tests.simulators.ports import MemoryPort
from tests.simulators.px4 import Px4
from tests.waiting import until
from ual.errors import UalError
from ual.types import Limits, State
from ual_daemon.backends import registry
from ual_daemon.backends.base import Backend, BackendOptions
from ual_daemon.backends.offers.cameras import CameraDrivers
from ual_daemon.backends.offers.fence import AutopilotFenceStore
from ual_daemon.backends.offers.gimbals import GimbalDrivers
from ual_daemon.backends.offers.logs import AutopilotLogs
from ual_daemon.backends.offers.missions import AutopilotMissions
from ual_daemon.backends.offers.parameters import AutopilotParameters
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.setpoint_sender import LONGEST_BLIND_S
from ual_daemon.flight.state import estimate

OPTIONS = BackendOptions("uav_1")


def airsim(stack: ExitStack, _: Path) -> Backend:
    server = stack.enter_context(AirsimServer([Vehicle("Drone1")]))
    return registry.make("airsim", BackendOptions("uav_1", server.url))


def mavros(_: ExitStack, __: Path) -> Backend:
    port = MemoryPort()
    return LockstepMavros(OPTIONS, Px4(port, is_terse=True), port)


MAKERS: dict[str, Callable[[ExitStack, Path], Backend]] = {
    "airsim": airsim,
    "crazyflie": lambda _, directory: LockstepCrazyflie(
        BackendOptions("uav_1", settings={"cache_directory": str(directory)})
    ),
    "dji": lambda *_: LockstepPsdk(OPTIONS),
    "light": lambda *_: registry.make("light", OPTIONS),
    "mavlink": lambda *_: LockstepPx4(OPTIONS),
    "mavros": mavros,
}


class Watched:
    """A backend that runs, and its updates; its thread can be stopped in one of them."""

    def __init__(self, backend: Backend) -> None:
        self.backend = backend
        self.updates: list[Snapshot] = []
        self.may_go_on = threading.Event()
        self.may_go_on.set()
        backend.open(self._take)

    def _take(self, snapshot: Snapshot) -> None:
        self.updates.append(snapshot)
        self.may_go_on.wait(LIMIT_S)

    def until(self, condition: Callable[[], object]) -> None:
        until(condition, seen=lambda: self.updates[-1:])

    def is_received(self) -> bool:
        found = self.updates[-1:]
        return bool(found) and estimate(found[0], self.backend.freshness).state is not State.UNINITIALIZED


@pytest.fixture(params=sorted(MAKERS))
def watched(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Watched]:
    with ExitStack() as stack:
        backend = MAKERS[request.param](stack, tmp_path)
        watched = Watched(backend)
        stack.callback(backend.close)
        stack.callback(watched.may_go_on.set)
        yield watched


def test_all_are_here() -> None:
    assert set(MAKERS) == set(registry._BUILT_IN)


def test_each_update_says_when_the_backend_last_sought_data(watched: Watched) -> None:
    """Else the guard against a starved computer (`AirsimSetpointSender`) is off."""
    watched.until(watched.is_received)
    heard_count = len(watched.updates)
    watched.until(lambda: len(watched.updates) > heard_count + 20)
    for update in watched.updates[1:]:
        assert math.isfinite(update.updated_s)
        assert update.updated_s <= update.time_s
    looked_s = [update.updated_s for update in watched.updates[heard_count:]]
    assert looked_s == sorted(looked_s)
    assert looked_s[-1] > looked_s[0]
    fresh = [update for update in watched.updates[heard_count:] if update.time_s - update.updated_s < LONGEST_BLIND_S]
    assert len(fresh) > 10


def test_the_newest_data_and_the_time_are_what_a_snapshot_is_made_of(watched: Watched) -> None:
    """Each setpoint of a stream takes them apart."""

    def are_the_same() -> bool:
        before, (newest, now_s), after = backend.snapshot(), backend.newest(), backend.snapshot()
        assert before.time_s <= now_s <= after.time_s
        return before.at(0.0) == newest.at(0.0) == after.at(0.0)  # else an update has come meanwhile

    backend = watched.backend
    watched.until(watched.is_received)
    watched.until(are_the_same)


def test_whatever_is_queried_of_one_that_is_closed_ends(watched: Watched) -> None:
    watched.until(watched.is_received)
    backend = watched.backend
    backend.close()
    commands = [backend.arm, backend.disarm, backend.take_control, backend.hold]
    commands += [lambda: backend.take_off(2.0, Limits()), lambda: backend.land(Limits())]
    asked: list[Callable[[], Future[Any]]] = [*commands, *drivers(backend)]
    for ask in asked:
        with suppress(UalError):  # it may be refused at once, too
            ended = ask()
            until(ended.done, f"the end of {ask}")
            ended.exception(0)


def drivers(backend: Backend) -> Iterator[Callable[[], Future[Any]]]:
    """Yields what reads or orders something beside flying."""
    parameters = backend.offer(AutopilotParameters)  # type: ignore[type-abstract]
    logs = backend.offer(AutopilotLogs)  # type: ignore[type-abstract]
    missions = backend.offer(AutopilotMissions)  # type: ignore[type-abstract]
    fence = backend.offer(AutopilotFenceStore)  # type: ignore[type-abstract]
    cameras = backend.offer(CameraDrivers)  # type: ignore[type-abstract]
    gimbals = backend.offer(GimbalDrivers)  # type: ignore[type-abstract]
    if parameters is not None:
        yield parameters.read_all
    if logs is not None:
        yield logs.read_all
    if missions is not None:
        yield missions.download
    if fence is not None:
        yield fence.read
    for camera in () if cameras is None else cameras.all():
        yield from (camera.status, camera.take_photo)
    for gimbal in () if gimbals is None else gimbals.all():
        yield gimbal.move_to_neutral
