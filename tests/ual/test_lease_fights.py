"""Two programs fight over one UAV, and are killed now and then: never do both fly it, and without either it stands.

``UAL_TEST_FIGHTS=1000`` fights as often; by default it is fewer times, for the time that it takes.
"""

from __future__ import annotations

import asyncio
import os
import random
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import ParamSpec, TypeVar

import pytest

from tests.conftest import LIMIT_S
from tests.waiting import until
from ual.types import State, TakeOffRequest, Telemetry
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.light import LightBackend
from ual_daemon.backends.values import Setpoint, VelocitySetpoint
from ual_daemon.server import addresses
from ual_daemon.server.server import Server
from ual_daemon.server.transport import selection
from ual_daemon.vehicle.vehicle import Vehicle

P = ParamSpec("P")
T = TypeVar("T")

FIGHTS = int(os.environ.get("UAL_TEST_FIGHTS", "40"))
YAW_RATES = {"left": 0.25, "right": -0.25}
AT_REST_M_S = 0.05


class Referee:
    """Sees each setpoint with the lease that is held just after it was sent.

    A lease that begins or ends stops the UAV right after it: until that is done, the setpoints from before go on. One
    more may be on its way then, as it was admitted before. A second one is a foul.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self.fouls: list[str] = []
        self.flown = dict.fromkeys(YAW_RATES, 0)
        self._on_its_way = ""
        self.leases_count = 0
        self._changes_count = 0
        self._vehicle = vehicle
        self._last = ""
        self._changed = threading.Condition()
        for name in ("acquire_lease", "release_lease", "_expire_lease"):
            setattr(vehicle, name, self._noted(getattr(vehicle, name)))
        vehicle.observe_setpoints(self._on_setpoint)
        vehicle.subscribe(lambda _: self._poll())

    def _noted(self, change: Callable[P, T]) -> Callable[P, T]:
        """Returns what changes the lease and stops the UAV, and notes that it is under way."""

        def noted(*args: P.args, **kwargs: P.kwargs) -> T:
            with self._changed:
                self._changes_count += 1
            try:
                return change(*args, **kwargs)
            finally:
                with self._changed:
                    self._changes_count -= 1

        return noted

    def _poll(self) -> None:
        lease = self._vehicle.lease()
        now = "" if lease is None else f"{lease.holder} {lease.since_s}"
        with self._changed:
            self.leases_count += bool(now) and now != self._last
            self._last = now
            self._changed.notify_all()

    def _on_setpoint(self, setpoint: Setpoint) -> None:
        held = self._vehicle.lease()
        if not isinstance(setpoint, VelocitySetpoint):
            return
        by = next((name for name, rate in YAW_RATES.items() if setpoint.yaw_rate_rad_s == rate), None)
        if by is None:
            return
        self.flown[by] += 1
        if (held is not None and held.holder == by) or self._changes_count:
            return
        foul = f"{by} flew under {held}, after {self.leases_count} leases"
        if foul == self._on_its_way:
            self.fouls.append(foul)
        self._on_its_way = foul

    def wait_for(self, leases_count: int) -> None:
        with self._changed:
            assert self._changed.wait_for(lambda: self.leases_count >= leases_count, LIMIT_S)


@contextmanager
def served() -> Iterator[tuple[str, Vehicle]]:
    """A light UAV that flies, and its address; served by an event loop on a thread of its own."""
    vehicle = Vehicle(LightBackend(BackendOptions("uav_1")))
    ready, stop, address = threading.Event(), threading.Event(), ""

    async def serve() -> None:
        nonlocal address
        transport = await selection.choose("auto")
        server = Server(vehicle, transport)
        [bound] = server.listen([addresses.parse("127.0.0.1:0")])
        await server.start()
        address = str(bound)
        ready.set()
        await asyncio.to_thread(stop.wait)
        server.begin_shutdown()
        await server.stop()
        transport.close()

    thread = threading.Thread(target=asyncio.run, args=(serve(),))
    thread.start()
    vehicle.open()
    try:
        assert ready.wait(LIMIT_S)
        yield address, vehicle
    finally:
        stop.set()
        thread.join(LIMIT_S)
        vehicle.close()


class Fighter:
    """One of the programs."""

    def __init__(self, address: str, name: str) -> None:
        self._arguments = ("-m", "tests.ual.lease_pilot", address, str(YAW_RATES[name]), name)
        self.problems: list[str] = []
        self.start()

    def start(self) -> None:
        self._process = subprocess.Popen([sys.executable, *self._arguments], stdout=subprocess.PIPE, text=True)
        self._reader = threading.Thread(target=self._read, args=(self._process,))
        self._reader.start()

    def kill(self) -> None:
        self._process.kill()
        self._process.wait(LIMIT_S)
        self._reader.join(LIMIT_S)

    def _read(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        with process.stdout:
            self.problems.extend(line for line in process.stdout if line != "held\n")


def take_off(vehicle: Vehicle) -> None:
    reached = threading.Event()
    vehicle.subscribe(lambda sample: reached.set() if sample.state is State.FLYING_AUTO else None)
    armed = threading.Event()
    vehicle.subscribe(lambda sample: armed.set() if sample.state is State.LANDED_ARMED else None)
    vehicle.simulation().pilot_arm()
    assert armed.wait(LIMIT_S)
    vehicle.commands.prepare(TakeOffRequest(3.0)).begin().future.result(LIMIT_S)
    assert reached.wait(LIMIT_S)


@pytest.mark.slow
def test_two_programs_fight_over_one_uav(runtime_dir: object) -> None:
    del runtime_dir
    chance = random.Random(1)
    with served() as (address, vehicle):
        take_off(vehicle)
        referee = Referee(vehicle)
        fighters = [Fighter(address, name) for name in YAW_RATES]
        try:
            for _ in range(FIGHTS):
                referee.wait_for(referee.leases_count + 1)
                if chance.random() < 0.1:
                    fighter = chance.choice(fighters)
                    fighter.kill()
                    fighter.start()
            until(lambda: all(referee.flown.values()), "flights of both")  # a busy computer may start one of them late
        finally:
            for fighter in fighters:
                fighter.kill()
        stands = threading.Event()
        vehicle.subscribe(lambda sample: stands.set() if is_nobodys_and_stands(vehicle, sample) else None)
        assert stands.wait(LIMIT_S)
        assert referee.fouls == []
        assert [problem for fighter in fighters for problem in fighter.problems] == []


def is_nobodys_and_stands(vehicle: Vehicle, sample: Telemetry) -> bool:
    velocity = sample.velocity
    return vehicle.lease() is None and velocity is not None and velocity.linear.norm() < AT_REST_M_S
