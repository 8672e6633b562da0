"""The loads whose instructions are counted: setpoints, a second of PX4's stream, served calls, a step of a fleet.

    python -m benchmarks.guard.loads PART...

runs under callgrind (`benchmarks.guard.callgrind`). Nothing here waits, and nothing depends on a clock.
"""

from __future__ import annotations

import asyncio
import itertools
import logging
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from unittest.mock import patch

from benchmarks.guard import defects
from benchmarks.guard.callgrind import Counter
from benchmarks.guard.plain import plain_send
from benchmarks.guard.replayed import ReplayedFlight, replayed
from tests.ual_daemon.stepped import STEP_S, Prepare, at
from tests.work.served import Served, served
from ual.geometry import Twist, Vector3
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.light import LightBackend
from ual_daemon.server import calls
from ual_daemon.server.standstill import Standstill
from ual_daemon.server.telemetry_stream import Updates
from ual_daemon.vehicle.vehicle import Vehicle

_TWISTS = tuple(map(Twist, (Vector3(0.1, 0.05, 0.0), Vector3(-0.1, 0.05, 0.0))))
_SLOW = (Vector3(0.3, 0.3, 0.0), Vector3(-0.3, -0.3, 0.0))
_WARM, _CALLS, _STEPS_BETWEEN = 120, 24, 5
_FLEET, _READ_EVERY = 20, 5
"""UAVs, and steps from one sample of a reader to the next: 10 Hz."""
_FAR_M = 1000.0


def in_process(counter: Counter) -> None:
    """`UAL.set_velocity`, and a second of PX4's stream with one reader: with room on all sides, and in a fence."""
    send = plain_send()
    for number in range(_WARM):
        send(number)
    with ExitStack() as stack:
        flights = {
            text: stack.enter_context(replayed(lambda _: None, has_fence=text == "in a fence"))
            for text in ("clear", "in a fence")
        }
        for flight in flights.values():
            for number in range(_WARM):
                flight.uav.set_velocity(_TWISTS[number % 2])
                flight.step()
            flight.run(1.0)
        counter.begin()
        counter.count("plain send", send, 50)
        for text, flight in flights.items():
            for number in range(_CALLS):
                for _ in range(_STEPS_BETWEEN):
                    flight.step()
                counter.count(f"set_velocity, {text}", partial(_set_velocity, flight, number))
            counter.count(f"a second of PX4's stream, {text}", partial(_run, flight))
            flight.unsubscribe()
            _update(flight, 0)
            counter.count(f"an update without a reader, {text}", partial(_update, flight), _CALLS)


def _set_velocity(flight: ReplayedFlight, number: int, _: int) -> None:
    flight.uav.set_velocity(_TWISTS[number % 2])


def _update(flight: ReplayedFlight, _: int) -> None:
    flight.update()


def _run(flight: ReplayedFlight, _: int) -> None:
    flight.run(1.0)


def behind_server(counter: Counter) -> None:
    """A setpoint and a sample behind the server: alone, and with access, a recording, an audit and a second reader."""
    for text, has_all in (("", False), (", with everything", True)):
        # callgrind on a busy computer is no standstill of a daemon
        still = patch.object(calls, "Standstill", partial(Standstill, itertools.repeat(0.0).__next__))
        with tempfile.TemporaryDirectory() as name, still:
            served(partial(_count_served, counter, text), Path(name), has_all=has_all)


def _count_served(counter: Counter, text: str, uav: Served) -> None:
    ways: Mapping[str, Callable[[Vector3], Callable[[], None]]] = {"stream": uav.stream(), "call": uav.call}
    for way, make in ways.items():
        send = [make(velocity) for velocity in _SLOW]
        for number in range(_WARM):
            send[number % 2]()
            if number % 10 == 0:
                uav.step()
        if way == "stream" and not text:
            counter.begin()
        counter.count(f"served {way}{text}", partial(_send, send), 40)
    send_one = uav.stream()(_SLOW[0])
    for _ in range(_WARM):
        send_one()
        uav.step()
    counter.count(f"served sample{text}", lambda _: uav.step(), 50)


def _send(send: list[Callable[[], None]], number: int) -> None:
    send[number % 2]()


def fleet(counter: Counter) -> None:
    """A step of a fleet whose UAVs fly a go-to, each with a reader at 10 Hz."""
    asyncio.run(_count_fleet(counter))


async def _count_fleet(counter: Counter) -> None:
    with _flying_fleet() as step:
        for _ in range(_WARM):
            step()
        counter.begin()
        counter.count(f"step of {_FLEET} light UAVs", lambda _: step(), 2 * _READ_EVERY)


@contextmanager
def _flying_fleet() -> Iterator[Callable[[], None]]:
    options = [BackendOptions(f"uav_{number}", settings={"speed_factor": 0}) for number in range(1, _FLEET + 1)]
    backends = LightBackend.fleet(options, [Vector3(5.0 * number, 0.0, 0.0) for number in range(_FLEET)])
    vehicles = [Vehicle(backend) for backend in backends]
    with ExitStack() as stack:
        for vehicle in vehicles:
            vehicle.open()
            stack.callback(vehicle.close)
            updates = Updates(vehicle, lambda _: None, clock=vehicle.clock.now_s)
            stack.callback(updates.close)
            updates.read(1.0 / (STEP_S * _READ_EVERY), lambda _, sent: sent(True))
        step = partial(vehicles[0].simulation().step, STEP_S)
        step()
        for vehicle in vehicles:
            vehicle.simulation().pilot_arm()
        step()
        climbs = [Prepare(vehicle).take_off(3.0).begin().future for vehicle in vehicles]
        while not all(climb.done() for climb in climbs):
            step()
        for vehicle in vehicles:
            Prepare(vehicle).go_to_waypoint(at(_FAR_M, 0.0, 10.0)).begin()
        yield step


_PARTS = {"class": in_process, "server": behind_server, "fleet": fleet}


def main() -> None:
    """Runs the parts that are named."""
    logging.disable(logging.CRITICAL)
    defects.install(os.environ.get(defects.VARIABLE, ""))
    for part in sys.argv[1:]:
        _PARTS[part](Counter())
    sys.stdout.flush()
    os._exit(0)  # what ends now is not counted, and valgrind makes it slow


if __name__ == "__main__":
    main()
