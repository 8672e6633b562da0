"""``python -m ual_daemon`` is ``ual-daemon``."""

from ual_daemon.program.entry import main

main()
