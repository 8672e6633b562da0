"""The end of a daemon that hangs, and a signal while it starts."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack

import pytest

from tests.conftest import LIMIT_S
from ual import discovery
from ual.interface import Simulation
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.light import LightBackend
from ual_daemon.backends.light.world import World
from ual_daemon.program import ending
from ual_daemon.program.daemon import Daemon, DaemonUav
from ual_daemon.program.namespace import Namespace
from ual_daemon.program.supervision import Supervision
from ual_daemon.server.addresses import parse
from ual_daemon.ual import UAL
from ual_daemon.vehicle.vehicle import Vehicle


def test_an_end_that_hangs_is_ended(caplog: pytest.LogCaptureFixture) -> None:
    has_ended = threading.Event()
    ending.within(0.0, has_ended.set)
    assert has_ended.wait(LIMIT_S)
    assert "end_too_slow" in caplog.text


class Watcher(Supervision):
    """Says what it is asked for; `end_at` is when it lets the daemon end."""

    def __init__(self, end_at: str) -> None:
        self.told: list[str] = []
        self._end_at = end_at
        self._stop: Callable[[], None]

    def watch(self, stop: Callable[[], None]) -> None:
        self._stop = stop
        self._tell("begin")

    async def may_serve(self) -> bool:
        self._tell("bound")
        return self._end_at != "refused"

    def serves(self, names: Sequence[str]) -> None:
        self._tell(f"serves {' '.join(names)}")

    def time_of(self, simulation: Simulation) -> Simulation:
        return simulation

    def ended(self) -> None:
        self.told.append("ended")

    def _tell(self, what: str) -> None:
        self.told.append(what)
        if what == self._end_at:
            self._stop()


@pytest.mark.usefixtures("runtime_dir")
@pytest.mark.parametrize(
    ("end_at", "told"),
    [
        ("begin", ["begin", "ended"]),
        ("bound", ["begin", "bound", "ended"]),
        ("refused", ["begin", "bound", "ended"]),
        ("serves uav_1 uav_2 uav_3", ["begin", "bound", "serves uav_1 uav_2 uav_3", "ended"]),
    ],
)
def test_a_fleet_ends_at_any_time_of_its_start(end_at: str, told: list[str]) -> None:
    world, watcher = World(), Watcher(end_at)
    with ExitStack() as held:
        uavs = []
        for ns in ("uav_1", "uav_2", "uav_3"):
            interface = UAL.over(Vehicle(LightBackend(BackendOptions(ns), world)), {})
            namespace = held.enter_context(Namespace(ns))
            uavs.append(DaemonUav(interface.vehicle, namespace, [parse("127.0.0.1:0")], interface))
        assert asyncio.run(Daemon(uavs, supervision=watcher).run())
    assert watcher.told == told
    assert not discovery.list_daemons()
