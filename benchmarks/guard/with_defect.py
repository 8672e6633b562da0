"""The daemon with the defect that the environment names, if any: what the guard measures the memory of."""

from __future__ import annotations

import os

from benchmarks.guard import defects
from ual_daemon.program.entry import main

if __name__ == "__main__":
    defects.install(os.environ.get(defects.VARIABLE, ""))
    main()
