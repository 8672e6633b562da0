"""Measures many UAVs in one daemon: whether it keeps real time, and what each UAV costs.

    python -m benchmarks.fleet [--seconds S] [--case flying 500 auto]...

A daemon with ``--fleet N`` and the light backend, every UAV armed by its simulated safety pilot, measured from outside:

    idle      nobody subscribes, all stand armed
    flying    each has a subscriber at 10 Hz over a connection of its own, and a go-to that lasts the whole measurement

Real time is measured as simulated seconds per real second. The largest lag is how much later than in the best case the
stamps of a UAV, read 50 times a second, ever were. Both are measured at the first UAV of each process, and the worst
counts. The processor's time is that of the daemon, all its processes and threads. The subscribers are one process
beside it (`benchmarks.stream_reader`). No process may use more than `_MOST_BYTES`.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import re
import resource
import statistics
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import grpc

from benchmarks.children import LIMIT_S, Child, ChildError, Process, processor_s, resident_mib
from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc
from ual_daemon.backends.light.physics import SIM_STEP_S
from ual_daemon.program import fleet
from ual_daemon.program.configuration import DaemonSettings

IDLE, FLYING = "idle", "flying"


class FleetCase(NamedTuple):
    """One fleet: what it does, how many UAVs, and the processes (`--workers`)."""

    what: str
    uavs: int
    workers: str = "1"

    def parts(self) -> list[range]:
        """Returns which UAVs each process flies, counted from 0."""
        workers: Any = self.workers if self.workers == "auto" else int(self.workers)
        return fleet.parts(DaemonSettings(fleet=self.uavs, workers=workers))


CASES = (
    *(FleetCase(IDLE, count) for count in (1, 10, 100, 1000)),
    FleetCase(IDLE, 4000, "auto"),
    *(FleetCase(FLYING, count) for count in (1, 10, 100, 200)),
    FleetCase(FLYING, 500, "auto"),
)
RATE_HZ = 10.0
LEAST_REAL_TIME = 0.99
LONGEST_LAG_S = 0.1
LEAST_RATE = 0.95
_ASK_PERIOD_S = 0.02
_SETTLING_S = 2.0
_FAR_M = 1000.0
_PRIORITY = 20
_MOST_AT_ONCE = 50
"""Connections of gRPC's client at the same time: each takes some MiB."""
_MOST_BYTES = 4 << 30


@dataclass(frozen=True)
class FleetResults:
    """The results of one fleet."""

    case: FleetCase
    workers_count: int
    share: float
    """The daemon's processor time, in seconds per second."""
    real_time: float
    lag_s: float
    resident_mib: float
    updates_hz: float
    """Updates of each UAV per second at the slowest (`ual_daemon.backends.light.world.Thinning`)."""
    load: float
    """Of the computer, at the end: how many processes wanted a processor."""
    rates_hz: Sequence[float] = ()
    """The rate of each subscriber."""

    @property
    def each(self) -> float:
        """The processor time of one UAV, in ms for each simulated second."""
        return self.share / self.real_time / self.case.uavs * 1000.0


class FleetDaemon(Process):
    """``ual-daemon --fleet N`` on unix sockets."""

    def __init__(self, case: FleetCase) -> None:
        self._directory = tempfile.TemporaryDirectory(prefix="ual-fleet-")
        self.count = case.uavs
        self._log = Path(self._directory.name, "log").open("wb")  # noqa: SIM115  closed in close
        super().__init__(
            [
                *(sys.executable, "-m", "ual_daemon", "--backend", "light", "--fleet", str(case.uavs), "--auto-arm"),
                *("--workers", case.workers, "--listen", f"unix:{self._directory.name}/{{ns}}.sock"),
            ],
            environment={"UAL_RUNTIME_DIR": self._directory.name},
            stderr=self._log,
        )

    def path(self, number: int) -> str:
        """Returns the socket of a UAV; numbers begin at 1."""
        return f"{self._directory.name}/uav_{number}.sock"

    def updates_hz(self) -> float:
        """Returns how often each UAV was updated, at the slowest so far."""
        text = Path(self._directory.name, "log").read_text(encoding="utf-8")
        return 1.0 / max((float(each) for each in re.findall(r"every ([\d.]+) s instead of", text)), default=SIM_STEP_S)

    def processor_s(self) -> float:
        return sum(processor_s(pid) for pid in self._pids())

    def resident_mib(self) -> float:
        return sum(resident_mib(pid) for pid in self._pids())

    def _pids(self) -> list[int]:
        children = Path(f"/proc/{self.pid}/task/{self.pid}/children").read_text()
        return [self.pid, *map(int, children.split())]

    def close(self) -> None:
        super().close()
        self._log.close()
        self._directory.cleanup()


Stub = Any  # gRPC's asyncio stubs have no type of their own at run time


@asynccontextmanager
async def connected(path: str) -> AsyncIterator[Stub]:
    """Provides a client of one UAV, on a connection of its own."""
    async with grpc.aio.insecure_channel(f"unix:{path}", [("grpc.use_local_subchannel_pool", 1)]) as channel:
        yield ual_pb2_grpc.UalServiceStub(channel)


async def with_each(daemon: FleetDaemon, act: Callable[[Stub], Awaitable[object]]) -> None:
    """Acts with each UAV, with some of them at once."""
    free = asyncio.Semaphore(_MOST_AT_ONCE)

    async def with_one(number: int) -> None:
        async with free, connected(daemon.path(number)) as stub:
            await act(stub)

    await asyncio.gather(*(with_one(number) for number in range(1, daemon.count + 1)))


async def _until(stub: Stub, state: pb.State.ValueType) -> None:
    deadline_s = time.monotonic() + LIMIT_S
    while time.monotonic() < deadline_s:
        try:
            answer = await stub.GetTelemetry(pb.GetTelemetryRequest(), wait_for_ready=True, timeout=LIMIT_S)
        except grpc.aio.AioRpcError as error:
            raise ChildError(f"the fleet does not answer: {error.details()}") from error
        if answer.telemetry.state == state:
            return
        await asyncio.sleep(0.2)
    raise ChildError(f"a UAV is not {pb.State.Name(state)} after {LIMIT_S:g} s")


async def take_off(stub: Stub) -> None:
    await stub.TakeOff(pb.TakeOffRequest(height_m=3.0, non_blocking=True), timeout=LIMIT_S)


async def fly_away(stub: Stub) -> None:
    """Sends a UAV to a goal that it does not reach meanwhile, once it has taken off."""
    await _until(stub, pb.STATE_FLYING_AUTO)
    request = pb.GoToWaypointRequest(non_blocking=True)
    request.waypoint.pose.position.x = _FAR_M
    request.waypoint.pose.position.z = 10.0
    await stub.GoToWaypoint(request, timeout=LIMIT_S)


async def lags(path: str, duration_s: float) -> tuple[float, float]:
    """Returns the simulated seconds per real second, and the largest lag of the stamps."""
    async with connected(path) as stub:
        return await _lags(stub, duration_s)


async def _lags(stub: Stub, duration_s: float) -> tuple[float, float]:
    begin_s, first_s = time.monotonic(), 0.0
    found: list[float] = []
    stamp_s = now_s = 0.0
    while time.monotonic() - begin_s < duration_s:
        asked_s = time.monotonic()
        answer = await stub.GetTelemetry(pb.GetTelemetryRequest(), timeout=LIMIT_S)
        now_s = (asked_s + time.monotonic()) / 2.0
        stamp = answer.telemetry.header.stamp
        stamp_s = stamp.seconds + stamp.nanos * 1e-9
        if not found:
            first_s, begin_s = stamp_s, now_s
        found.append(now_s - stamp_s)
        await asyncio.sleep(_ASK_PERIOD_S)
    return (stamp_s - first_s) / (now_s - begin_s), max(found) - min(found)


async def measure(case: FleetCase, daemon: FleetDaemon, readers: Child, duration_s: float) -> FleetResults:
    parts = case.parts()
    await with_each(daemon, lambda stub: _until(stub, pb.STATE_LANDED_ARMED))
    if case.what == FLYING:
        await with_each(daemon, take_off)
        await with_each(daemon, fly_away)
        readers.ask("open", paths=[daemon.path(number) for number in range(1, case.uavs + 1)])
    await asyncio.to_thread(readers.ask, "read", duration_s=_SETTLING_S)  # leaves out the cost of the start
    used_s, begin_s = daemon.processor_s(), time.monotonic()
    reading = asyncio.create_task(asyncio.to_thread(readers.ask, "read", duration_s=duration_s))
    found = await asyncio.gather(*(lags(daemon.path(part.start + 1), duration_s) for part in parts))
    share = (daemon.processor_s() - used_s) / (time.monotonic() - begin_s)
    rates = (await reading)["rates_hz"]
    if case.what == FLYING:
        await with_each(daemon, lambda stub: _until(stub, pb.STATE_FLYING_AUTO))  # all still fly
    real_time, lag_s = min(each[0] for each in found), max(each[1] for each in found)
    return FleetResults(
        case, len(parts), share, real_time, lag_s, daemon.resident_mib(), daemon.updates_hz(), os.getloadavg()[0], rates
    )


def verdicts(found: Sequence[FleetResults]) -> Iterator[tuple[str, float, str, bool]]:
    """Returns the targets of the largest fleets: name, figure, limit as text, and whether it is met."""
    largest = {(each.case.what, each.case.workers): each for each in found if each.case.uavs >= 200}
    for most in largest.values():
        name = f"{most.case.uavs:,d} {most.case.what}, {most.workers_count} workers"
        yield f"{name}: real time held", most.real_time, f">= {LEAST_REAL_TIME}", most.real_time >= LEAST_REAL_TIME
        yield f"{name}: fell behind, s", most.lag_s, f"<= {LONGEST_LAG_S}", most.lag_s <= LONGEST_LAG_S
        if most.rates_hz:
            rate = min(most.rates_hz) / RATE_HZ
            yield f"{name}: slowest subscriber's rate", rate, f">= {LEAST_RATE}", rate >= LEAST_RATE


def _prefer() -> str:
    """Gives this process, and the daemons that it starts, priority if permitted. Returns how."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY))
    except PermissionError:
        return "none: the system does not allow real time"
    return "real time (SCHED_FIFO)"


def _limit_memory() -> None:
    """Bounds the memory of this process and of each that it starts."""
    _, most = resource.getrlimit(resource.RLIMIT_DATA)
    limit = _MOST_BYTES if most == resource.RLIM_INFINITY else min(_MOST_BYTES, most)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, most))


def main() -> None:
    parser = argparse.ArgumentParser(description="Many UAVs in one daemon.")
    parser.add_argument("--seconds", type=float, default=15.0, help="how long each fleet is measured  [15]")
    parser.add_argument("--priority", action="store_true", help="have the daemon run before all other programs")
    parser.add_argument(
        "--case", nargs=3, action="append", metavar=("idle|flying", "N", "WORKERS"), help="measure this fleet only"
    )
    arguments = parser.parse_args()
    cases = [FleetCase(what, int(count), workers) for what, count, workers in arguments.case or ()] or CASES
    _limit_memory()
    print(f"{len(os.sched_getaffinity(0))} processors; priority: {_prefer() if arguments.priority else 'none'}\n")
    print(
        f"{'':7}{'UAVs':>5}{'workers':>9}{'cpu s/s':>9}{'ms each':>9}{'real time':>11}{'behind s':>10}{'MiB':>6}"
        f"{'updates':>9}{'load':>6}{'Hz':>7}{'least':>7}"
    )
    found = []
    for case in cases:
        with FleetDaemon(case) as daemon, Child("benchmarks.stream_reader", str(RATE_HZ)) as readers:
            each = asyncio.run(measure(case, daemon, readers, arguments.seconds))
        found.append(each)
        rates = f"{statistics.median(each.rates_hz):7.2f}{min(each.rates_hz):7.2f}" if each.rates_hz else ""
        print(
            f"{case.what:7}{case.uavs:5d}{each.workers_count:9d}{each.share:9.3f}{each.each:9.3f}{each.real_time:11.4f}"
            f"{each.lag_s:10.3f}{each.resident_mib:6.0f}{each.updates_hz:9.1f}{each.load:6.1f}{rates}",
            flush=True,
        )
    print()
    is_met = True
    for name, figure, limit, passes in verdicts(found):
        is_met &= passes
        print(f"{name:48}{figure:8.3f}  {limit:8}  {'PASS' if passes else 'FAIL'}")
    sys.exit(not is_met)


if __name__ == "__main__":
    main()
