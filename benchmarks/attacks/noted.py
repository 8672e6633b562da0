"""``ual-daemon`` whose light backend notes each setpoint that it gets: ``python -m benchmarks.attacks.noted ...``.

It is the backend ``noted``: the light one, which also sends the yaw rate of each setpoint to the UDP port that
``ATTACKS_NOTED_PORT`` names.
"""

from __future__ import annotations

import os
import socket
from contextlib import suppress
from importlib.metadata import EntryPoint

from typing_extensions import override

from benchmarks.attacks.autopilot import NUMBER
from ual_daemon.backends import registry
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.light import LightBackend, World
from ual_daemon.backends.values import Setpoint
from ual_daemon.program.main import main


class NotedBackend(LightBackend):
    """The light backend, which tells a port of each setpoint."""

    def __init__(self, options: BackendOptions, world: World | None = None) -> None:
        super().__init__(options, world)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(("127.0.0.1", int(os.environ["ATTACKS_NOTED_PORT"])))
        self._socket.setblocking(False)

    @override
    def send(self, setpoint: Setpoint) -> None:
        super().send(setpoint)
        with suppress(OSError):
            self._socket.send(NUMBER.pack(setpoint.yaw_rate_rad_s))


if __name__ == "__main__":
    registry.entry_points = lambda: (EntryPoint("noted", "benchmarks.attacks.noted:NotedBackend", registry.GROUP),)
    main()
