"""The entry point of ``ual-daemon``: so small that Ctrl-C finds it ready from the beginning."""

from __future__ import annotations

import signal


def main() -> None:
    """Runs the daemon. Until it flies there is nothing to be ended with care, so that Ctrl-C ends it at once."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from ual_daemon.program.main import main as run  # takes a tenth of a second

    run()
