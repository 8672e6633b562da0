"""All callers, as one process: ``python -m benchmarks.soak.callers HOST:PORT ...``. ``counts`` returns their acts."""

from __future__ import annotations

import sys
import threading
from typing import Any

from benchmarks.children import serve
from benchmarks.soak.disturbances import Disturbances
from benchmarks.soak.pilot import SoakPilot
from benchmarks.soak.tally import Tally


def main() -> None:
    stopped = threading.Event()
    tallies = {address: Tally() for address in sys.argv[1:]}
    threads = [
        threading.Thread(target=work.run, daemon=True)
        for seed, (address, tally) in enumerate(tallies.items())
        for work in (SoakPilot(address, tally, seed, stopped), Disturbances(address, tally, seed, stopped))
    ]
    for thread in threads:
        thread.start()

    def handle(_: dict[str, Any]) -> dict[str, Any]:
        alive_count = sum(thread.is_alive() for thread in threads)
        return {"alive": alive_count, "counts": {address: tally.counts() for address, tally in tallies.items()}}

    serve(handle)
    stopped.set()


if __name__ == "__main__":
    main()
