"""Runs a module with the stations of a kind of process wrapped: ``python -m benchmarks.sample_trace.traced ...``.

Arguments: the file for the stamps, ``times`` or ``calls``, the kind (`stations.OF`), the module, and its arguments.
SIGUSR1 writes what was stamped since the last time.
"""

from __future__ import annotations

import json
import runpy
import signal
import sys
from pathlib import Path

from benchmarks.sample_trace.stamps import Stamps
from benchmarks.sample_trace.stations import OF


def main() -> None:
    path, what, kind, module = sys.argv[1:5]
    stamps = Stamps()
    for station in OF[kind]():
        stamps.wrap(station)
    if what == "calls":
        stamps.count_calls()

    def write(*_: object) -> None:
        unfinished = Path(f"{path}.part")
        unfinished.write_text(json.dumps(stamps.take()))
        unfinished.replace(path)

    signal.signal(signal.SIGUSR1, write)
    sys.argv = [module, *sys.argv[5:]]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


main()
