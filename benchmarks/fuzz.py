"""Feeds a MAVLink session with bytes that no autopilot sends: ``python -m benchmarks.fuzz --bytes 10000000``.

Random bytes, bytes dense in beginnings of frames, real packets repeated, damaged, and changed with a right checksum,
and invented messages. Prints for each kind what a byte costs, and by how much memory grew. Exit status 1 when an error
was logged, or when memory grew by more than `_LIMIT_MIB`. With ``--calls 100000`` it calls a daemon instead
(`benchmarks.fuzz_calls`).
"""

from __future__ import annotations

import argparse
import gc
import logging
import sys
import time
import tracemalloc

from typing_extensions import override

from benchmarks.fuzz_calls import fuzz_calls
from tests.ual_daemon.backends.mavlink.fuzz import KINDS, Fuzz

_LIMIT_MIB = 0.5
_WARM_SHARE = 0.2
"""Share of the bytes that is fed before memory is measured for the first time."""


class _Errors(logging.Handler):
    """Counts errors and tracebacks."""

    count = 0

    @override
    def emit(self, record: logging.LogRecord) -> None:
        if record.exc_info or record.levelno >= logging.ERROR:
            self.count += 1
            print(self.format(record), file=sys.stderr)


def main() -> int:
    """Returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fuzz", description=__doc__)
    parser.add_argument("--bytes", type=int, default=10_000_000, help="in all")
    parser.add_argument("--calls", type=int, default=0, help="so many calls of a daemon, instead of bytes")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    if arguments.calls:
        return int(not fuzz_calls(arguments.calls, arguments.seed))
    errors = _Errors()
    logging.getLogger().addHandler(errors)
    tracemalloc.start()
    grown = [
        _feed(Fuzz(kind, is_stream=is_stream, seed=arguments.seed), kind, arguments.bytes // (2 * len(KINDS)))
        for kind in KINDS
        for is_stream in (False, True)
    ]
    return int(errors.count > 0 or max(grown) > _LIMIT_MIB)


def _feed(fuzz: Fuzz, kind: str, bytes_count: int) -> float:
    """Feeds one session. Returns by how many MiB memory has grown."""
    while fuzz.bytes_count < bytes_count * _WARM_SHARE:
        fuzz.step()
    warm_mib = _memory_mib()
    began_s, began = time.thread_time(), fuzz.bytes_count
    while fuzz.bytes_count < bytes_count:
        fuzz.step()
    cost_us = (time.thread_time() - began_s) / (fuzz.bytes_count - began) * 1e6
    grown_mib = _memory_mib() - warm_mib
    way = "stream" if fuzz.harness.link.is_stream else "datagrams"
    print(f"{kind:9} {way:9} {fuzz.bytes_count:9,d} bytes {cost_us:6.2f} us/byte {grown_mib:+6.2f} MiB", flush=True)
    return grown_mib


def _memory_mib() -> float:
    gc.collect()
    return tracemalloc.get_traced_memory()[0] / 2**20


if __name__ == "__main__":
    sys.exit(main())
