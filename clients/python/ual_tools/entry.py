"""The entry point of ``ual``: so small that Ctrl-C finds it ready from the beginning."""

from __future__ import annotations

import sys

_INTERRUPTED = 130


def main() -> None:
    """Runs the command. Ctrl-C ends it without a word, also while it still starts."""
    try:
        from ual_tools.main import main as run  # takes a tenth of a second

        run()
    except KeyboardInterrupt:
        sys.exit(_INTERRUPTED)
