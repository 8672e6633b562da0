"""An aircraft that is not heard, because its wrapper stalls or has died."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial

import pytest

from tests.simulators.dji import Psdk
from tests.simulators.lockstep_dji import LockstepDji, LockstepOsdk, LockstepOsdkVehicle, LockstepPsdk
from tests.simulators.rosbridge import Message, Service
from tests.ual_daemon.backends.dji.test_dji_flights import fly, ready, until, wait
from ual.errors import LinkLostError
from ual.geometry import Pose
from ual.types import State

LIMIT_S = 60.0
KINDS = (LockstepPsdk, LockstepOsdk, LockstepOsdkVehicle)


class LogsOn:
    """Another node, which logs five times a second: rosbridge itself does."""

    topics: Mapping[str, str] = {}  # /rosout is there always
    subscriptions: Mapping[str, tuple[str, Callable[[Message], None]]] = {}
    services: Mapping[str, Service] = {}

    def __init__(self, ros: int) -> None:
        self._ros = ros
        self._due_s = 0.0

    def step(self, now_s: float) -> Iterator[tuple[str, Message]]:
        if now_s >= self._due_s:
            self._due_s = now_s + 0.2
            stamp = {"sec": int(now_s), "nanosec": 0}
            stamped: Message = {"stamp": stamp} if self._ros == 2 else {"header": {"stamp": stamp}}
            yield "/rosout", {**stamped, "level": 20 if self._ros == 2 else 2, "name": "rosbridge", "msg": "[Client 1]"}


def silence(backend: LockstepDji, *, is_silent: bool = True) -> None:
    """Lets the wrapper stall, or go on."""
    with backend.lock:
        for topic in backend.bridge.nodes[0].topics:
            (set.add if is_silent else set.discard)(backend.bridge.faults.silent_topics, topic)


class LockstepSlow(LockstepPsdk):
    """It publishes its state once a second, as the wrapper does by default."""

    front = partial(Psdk, state_rate_hz=1.0)


def test_the_log_of_another_node_hides_no_silence() -> None:
    with ready(LockstepSlow) as (uav, backend):
        fly(uav)
        backend.bridge.nodes.append(LogsOn(backend.ros))
        for n, east in enumerate((30.0, -30.0, 30.0, -30.0)):
            uav.go_to_waypoint(Pose.at(east, 0.0, 5.0), blocking=False)
            wait(backend, 2.0 + 0.13 * n)
            silence(backend)
            wait(backend, 0.1)
            with backend.lock:
                backend.aircraft.pilot_takes_over()
            wait(backend, 1.2)
            silence(backend, is_silent=False)
            back_s = backend.aircraft.now_s
            until(lambda: uav.state() is State.FLYING_MANUAL)
            assert not [time_s for time_s, _, _ in backend.aircraft.setpoints if time_s > back_s]
            uav.recover_from_manual()


@pytest.mark.parametrize("kind", KINDS)
def test_a_node_that_has_died_while_another_logs_is_a_lost_link(kind: type[LockstepDji]) -> None:
    with ready(kind) as (uav, backend):
        fly(uav)
        task = uav.go_to_waypoint(Pose.at(30.0, 0.0, 5.0), blocking=False)
        wait(backend, 1.0)
        with backend.lock:
            backend.bridge.nodes[:] = [LogsOn(backend.ros)]
        until(lambda: uav.state() is State.UNINITIALIZED)
        with pytest.raises(LinkLostError):
            task.wait(LIMIT_S)
        with pytest.raises(LinkLostError):
            uav.land()
        assert "nothing heard" in uav.telemetry().state_reason
