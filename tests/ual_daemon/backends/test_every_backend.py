"""What every backend owes the layers above, whichever autopilot it drives."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

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
from ual.types import State
from ual_daemon.backends import registry
from ual_daemon.backends.base import Backend, BackendOptions
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

    def is_heard(self) -> bool:
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


def test_each_update_says_when_the_backend_last_looked_for_data(watched: Watched) -> None:
    """Else the guard against a starved computer (`SetpointSender`) is off."""
    watched.until(watched.is_heard)
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
