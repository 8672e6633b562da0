"""``python -m ual_daemon`` is ``ual-daemon``."""

from ual_daemon.program.main import main

main()
