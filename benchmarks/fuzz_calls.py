"""Calls a daemon with a flying UAV in ways that no sane caller does, for ``python -m benchmarks.fuzz --calls``.

The calls are those of `tests.ual_daemon.server.fuzzed_calls`. Methods of the simulation are left out: they may crash a
simulated UAV, which is what they are for.
"""

from __future__ import annotations

import re
import threading
import time
from collections import Counter

import grpc

import ual
from benchmarks.servers import UalDaemon
from benchmarks.soak.readings import read
from tests.ual_daemon.server.fuzzed_calls import defects_of, storm
from ual.errors import UalError
from ual.types import State
from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc as pb_grpc

_CALLERS = 8
_BATCH = 100
_HEIGHT_M = 5.0
_WARM_SHARE = 0.3
"""Share of the calls after which memory is measured for the first time: then the histories of tasks and frames are
full.
"""
_LIMIT_MIB = 1.0
_LINE_S = 10.0
_LIMIT_S = 60.0
_DEFECT = re.compile(r"Traceback|\bdefect\b|failed unexpectedly")


class _Storm:
    """The callers, each of which makes batch after batch until there were enough calls."""

    def __init__(self, address: str, count: int, seed: int) -> None:
        self._address = address
        self._batches = iter(range(seed, seed + count // _BATCH))
        self._lock = threading.Lock()
        self.found: Counter[str] = Counter()
        self.threads = [threading.Thread(target=self._run, daemon=True) for _ in range(_CALLERS)]
        for thread in self.threads:
            thread.start()

    @property
    def is_over(self) -> bool:
        return not any(thread.is_alive() for thread in self.threads)

    @property
    def count(self) -> int:
        with self._lock:
            return self.found.total()

    def _run(self) -> None:
        while (seed := self._next()) is not None:
            ended = storm(self._address, _BATCH, seed)
            with self._lock:
                self.found.update(ended)

    def _next(self) -> int | None:
        with self._lock:
            return next(self._batches, None)


def fuzz_calls(count: int, seed: int) -> bool:
    """Makes so many calls. Prints what came of it, and returns whether nothing is wrong."""
    with UalDaemon(None, "--auto-arm") as daemon:
        daemon.wait()
        address = daemon.addresses["tcp"]
        wrong: Counter[str] = Counter()
        with ual.Uav(address=address) as uav, grpc.insecure_channel(address) as channel:
            stub = pb_grpc.UalServiceStub(channel)
            _fly(uav)
            began_s = line_s = time.monotonic()
            calls, warm_mib, flights_count = _Storm(address, count, seed), 0.0, 1
            while not calls.is_over:
                wrong.update(defects_of(stub.GetTelemetry(pb.GetTelemetryRequest(), timeout=_LIMIT_S).telemetry))
                flights_count += _fly(uav)
                mib = read(daemon, 0.0).resident_mib
                if calls.count < count * _WARM_SHARE:
                    warm_mib = mib
                if time.monotonic() - line_s >= _LINE_S:
                    line_s = time.monotonic()
                    print(f"{calls.count:9,d} calls {mib:7.2f} MiB {dict(wrong) or ''}", flush=True)
                time.sleep(0.2)
            duration_s = time.monotonic() - began_s
            time.sleep(2.0)
            grown_mib = read(daemon, 0.0).resident_mib - warm_mib
            lands = _lands(uav)
        logged = [line for line in daemon.log_text().splitlines() if _DEFECT.search(line)]
    print(f"{calls.count:,d} calls in {duration_s:.0f} s during {flights_count} flights: {dict(calls.found)}")
    print(f"memory {grown_mib:+.2f} MiB after the first {_WARM_SHARE:.0%}; it lands: {lands}; wrong: {dict(wrong)}")
    print(f"{len(logged)} lines of the log tell of a defect", *logged[:20], sep="\n  ")
    return not wrong and not logged and lands and grown_mib <= _LIMIT_MIB


def _fly(uav: ual.Uav) -> int:
    """Takes off if it stands: a call has landed it. Returns 1 if it did."""
    try:
        if uav.state() is State.LANDED_ARMED:
            uav.take_off(_HEIGHT_M, blocking=False)
            return 1
        if uav.state() is State.LANDED_DISARMED:
            uav.simulation.pilot_arm()
    except UalError:
        return 0  # another call was first
    return 0


def _lands(uav: ual.Uav) -> bool:
    """Returns whether it obeys after all this."""
    try:
        if uav.wait_for(State.FLYING_AUTO, State.LANDED_ARMED, timeout_s=_LIMIT_S) is State.LANDED_ARMED:
            uav.take_off(_HEIGHT_M, timeout_s=_LIMIT_S)
        uav.land(timeout_s=_LIMIT_S)
    except UalError as error:
        print(error)
        return False
    return True
