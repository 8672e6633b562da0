"""``ual-daemon`` that goes on sending its last setpoint, whoever flies: the campaign must find it.

``python -m tests.campaign --module tests.campaign.bad_daemon ...``
"""

from __future__ import annotations

import threading
from collections.abc import Callable

from ual_daemon.backends.mavlink import MavlinkBackend
from ual_daemon.backends.values import Setpoint
from ual_daemon.program.main import main

_PERIOD_S = 0.05


class Stubborn:
    """Repeats the last setpoint for ever."""

    def __init__(self, send: Callable[[MavlinkBackend, Setpoint], None]) -> None:
        self._send = send
        self._last: tuple[MavlinkBackend, Setpoint] | None = None
        threading.Thread(target=self._run, daemon=True).start()

    def send(self, backend: MavlinkBackend, setpoint: Setpoint) -> None:
        self._last = (backend, setpoint)
        self._send(backend, setpoint)

    def _run(self) -> None:
        while not threading.Event().wait(_PERIOD_S):
            if self._last is not None:
                self._send(*self._last)


if __name__ == "__main__":
    stubborn = Stubborn(MavlinkBackend.send)

    def send(backend: MavlinkBackend, setpoint: Setpoint) -> None:
        stubborn.send(backend, setpoint)

    MavlinkBackend.send = send  # type: ignore[method-assign, assignment]
    main()
