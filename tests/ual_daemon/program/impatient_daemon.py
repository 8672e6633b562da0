"""``ual-daemon`` that waits only 1 s for its UAV when it ends."""

from __future__ import annotations

from ual_daemon.program import daemon
from ual_daemon.program.main import main

if __name__ == "__main__":
    daemon._SAFE_EXIT_LIMIT_S = 1.0
    main()
