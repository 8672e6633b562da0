"""The entry point of ``ual``: so small that Ctrl-C finds it ready from the beginning."""

from __future__ import annotations

import signal
import sys

_INTERRUPTED_STATUS = 130


def main() -> None:
    """Runs the command. Ctrl-C ends it without a word, also while it still starts.

    Until it has started the system ends it: Python loses an interruption that comes in a callback of an import.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from ual_tools.main import main as run  # takes a tenth of a second

    try:
        run()
    except KeyboardInterrupt:
        sys.exit(_INTERRUPTED_STATUS)
