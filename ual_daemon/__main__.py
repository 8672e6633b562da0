"""``python -m ual_daemon`` is ``ual-daemon``."""

from ual_daemon.main import main

main()
