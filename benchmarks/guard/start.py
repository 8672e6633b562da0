"""The daemon until its first answer, as a program that callgrind counts from its first instruction on.

    python -m benchmarks.guard.start PORT VEHICLE_PORT

serves at a port of this computer, for an autopilot that says nothing.
"""

from __future__ import annotations

import functools
import os
import sys
from typing import Any, NoReturn

from benchmarks.guard.callgrind import Counter

NAME = "start to the first answer"


def main() -> None:
    """Runs the daemon, and ends with the answer to the first GetInfo."""
    port, vehicle_port = sys.argv[1:]
    sys.argv = ["ual-daemon", "--backend", "mavlink", "--url", f"udpin://127.0.0.1:{vehicle_port}"]
    sys.argv += ["--listen", f"127.0.0.1:{port}"]
    from ual_daemon.program import entry
    from ual_daemon.server.uav_service import UalServicer

    answer = UalServicer.GetInfo
    counter = Counter()

    @functools.wraps(answer)
    def counted(*args: Any) -> NoReturn:  # noqa: ANN401  as the method
        answer(*args)
        counter.dump(NAME)
        os._exit(0)

    setattr(UalServicer, "GetInfo", counted)  # noqa: B010
    entry.main()


if __name__ == "__main__":
    main()
