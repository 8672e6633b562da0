"""Measures many UAVs in one daemon: whether it keeps real time, and what each UAV costs.

    python -m benchmarks.fleet [--seconds S]

A daemon with ``--fleet N`` and the light backend, every UAV armed by its simulated safety pilot, measured from outside:

    idle      nobody subscribes, all stand armed
    flying    each has a subscriber at 10 Hz over a connection of its own, and a go-to that lasts the whole measurement

Real time is measured as simulated seconds per real second. The largest lag is how much later than in the best case the
stamps of uav_1, read 50 times a second, ever were. The processor's share is that of the
daemon, all its threads. The subscribers are one process beside it.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import statistics
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import grpc

from benchmarks.children import LIMIT_S, ChildError, Process
from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc

IDLE, FLYING = "idle", "flying"
COUNTS = {IDLE: (1, 10, 100, 1000), FLYING: (1, 10, 100, 200)}
RATE_HZ = 10.0
LEAST_REAL_TIME = 0.99
LONGEST_LAG_S = 0.1
LEAST_RATE = 0.95
MOST_GROWTH = 1.5
_ASK_PERIOD_S = 0.02
_FAR_M = 1000.0
_PRIORITY = 20


@dataclass(frozen=True)
class Found:
    """The results of one fleet."""

    what: str
    count: int
    share: float
    """The daemon's share of one core."""
    real_time: float
    lag_s: float
    resident_mib: float
    rates_hz: Sequence[float] = ()
    """The rate of each subscriber."""

    @property
    def each(self) -> float:
        """The share of one core that one UAV needs, in thousandths."""
        return self.share / self.count * 1000.0


class FleetDaemon(Process):
    """``ual-daemon --fleet N`` on unix sockets."""

    def __init__(self, count: int) -> None:
        self._directory = tempfile.TemporaryDirectory(prefix="ual-fleet-")
        self.count = count
        self._log = Path(self._directory.name, "log").open("wb")  # noqa: SIM115  closed in close
        super().__init__(
            [
                *(sys.executable, "-m", "ual_daemon", "--backend", "light", "--fleet", str(count), "--auto-arm"),
                *("--listen", f"unix:{self._directory.name}/{{ns}}.sock"),
            ],
            environment={"UAL_RUNTIME_DIR": self._directory.name},
            stderr=self._log,
        )

    def address(self, number: int) -> str:
        """Returns the address of a UAV; numbers begin at 1."""
        return f"unix:{self._directory.name}/uav_{number}.sock"

    def close(self) -> None:
        super().close()
        self._log.close()
        self._directory.cleanup()


Stub = Any  # gRPC's asyncio stubs have no type of their own at run time


@asynccontextmanager
async def connected(daemon: FleetDaemon) -> AsyncIterator[list[Stub]]:
    """Provides a client for each UAV, on a connection of its own, once all UAVs are armed on the ground."""
    async with AsyncExitStack() as stack:
        stubs = []
        for number in range(1, daemon.count + 1):
            options = [("grpc.use_local_subchannel_pool", 1)]
            channel = await stack.enter_async_context(grpc.aio.insecure_channel(daemon.address(number), options))
            stubs.append(ual_pb2_grpc.UalServiceStub(channel))
        await asyncio.gather(*(_until(stub, pb.STATE_LANDED_ARMED) for stub in stubs))
        yield stubs


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


async def fly(stubs: Sequence[Stub]) -> None:
    """Takes off with all UAVs and sends each to a goal."""
    up = (stub.TakeOff(pb.TakeOffRequest(height_m=3.0), timeout=LIMIT_S) for stub in stubs)
    await asyncio.gather(*up)
    request = pb.GoToWaypointRequest(non_blocking=True)
    request.waypoint.pose.position.x = _FAR_M
    request.waypoint.pose.position.z = 10.0
    await asyncio.gather(*(stub.GoToWaypoint(request, timeout=LIMIT_S) for stub in stubs))


async def subscriber(stub: Stub, counts: list[int], index: int) -> None:
    """Counts the telemetry that it gets."""
    async for _ in stub.StreamTelemetry(pb.StreamTelemetryRequest(rate_hz=RATE_HZ)):
        counts[index] += 1


async def lags(stub: Stub, duration_s: float) -> tuple[float, float]:
    """Returns the simulated seconds per real second, and the largest lag of the stamps."""
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


async def measure(what: str, daemon: FleetDaemon, duration_s: float) -> Found:
    async with connected(daemon) as stubs:
        readers: list[asyncio.Task[None]] = []
        counts = [0] * len(stubs)
        if what == FLYING:
            await fly(stubs)
            readers = [asyncio.create_task(subscriber(stub, counts, i)) for i, stub in enumerate(stubs)]
        await asyncio.sleep(2.0)  # leaves out the cost of the start
        used_s, begin_s, before = daemon.processor_s(), time.monotonic(), list(counts)
        real_time, lag_s = await lags(stubs[0], duration_s)
        passed_s = time.monotonic() - begin_s
        share = (daemon.processor_s() - used_s) / passed_s
        rates = [(count - old) / passed_s for count, old in zip(counts, before, strict=True)] if readers else []
        for reader in readers:
            reader.cancel()
        ended = await asyncio.gather(*readers, return_exceptions=True)
        for error in ended:
            if not isinstance(error, asyncio.CancelledError):
                raise ChildError(f"a subscriber ended: {error}")
        if what == FLYING:
            await asyncio.gather(*(_until(stub, pb.STATE_FLYING_AUTO) for stub in stubs))  # all still fly
        return Found(what, daemon.count, share, real_time, lag_s, daemon.resident_mib(), rates)


def verdicts(found: Sequence[Found]) -> Iterator[tuple[str, float, str, bool]]:
    """Returns the targets: name, figure, limit as text, and whether it is met."""
    by_name = {(each.what, each.count): each for each in found}
    for what in (IDLE, FLYING):
        most = by_name[what, COUNTS[what][-1]]
        name = f"{most.count:,d} {what}"
        yield f"{name}: real time held", most.real_time, f">= {LEAST_REAL_TIME}", most.real_time >= LEAST_REAL_TIME
        yield f"{name}: fell behind, s", most.lag_s, f"<= {LONGEST_LAG_S}", most.lag_s <= LONGEST_LAG_S
        if most.rates_hz:
            rate = min(most.rates_hz) / RATE_HZ
            yield f"{name}: slowest subscriber's rate", rate, f">= {LEAST_RATE}", rate >= LEAST_RATE
        growth = most.each / by_name[what, 100].each
        yield f"{name}: cost of each, of that among 100", growth, f"<= {MOST_GROWTH}", growth <= MOST_GROWTH


def _prefer() -> str:
    """Gives this process, and the daemons that it starts, priority if permitted. Returns how."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY))
    except PermissionError:
        return "none: the system does not allow real time"
    return "real time (SCHED_FIFO)"


def main() -> None:
    parser = argparse.ArgumentParser(description="Many UAVs in one daemon.")
    parser.add_argument("--seconds", type=float, default=15.0, help="how long each fleet is measured  [15]")
    duration_s = parser.parse_args().seconds
    found = []
    print(f"Priority: {_prefer()}\n")
    print(f"{'':8}{'UAVs':>6}{'of a core':>11}{'each, ‰':>9}{'real time':>11}{'behind s':>10}{'MiB':>7}{'Hz':>7}")
    for what, counts in COUNTS.items():
        for count in counts:
            with FleetDaemon(count) as daemon:
                each = asyncio.run(measure(what, daemon, duration_s))
            found.append(each)
            rate = f"{statistics.median(each.rates_hz):7.2f}" if each.rates_hz else ""
            print(
                f"{what:8}{count:6d}{each.share:11.3f}{each.each:9.3f}{each.real_time:11.4f}{each.lag_s:10.3f}"
                f"{each.resident_mib:7.0f}{rate}",
                flush=True,
            )
    print()
    is_met = True
    for name, figure, limit, passes in verdicts(found):
        is_met &= passes
        print(f"{name:46}{figure:8.3f}  {limit:8}  {'PASS' if passes else 'FAIL'}")
    sys.exit(not is_met)


if __name__ == "__main__":
    main()
