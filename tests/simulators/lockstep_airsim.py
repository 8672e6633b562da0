"""The AirSim backend and a small AirSim on one clock: the vehicle's time is that of the computer, too.

Its time advances by polls, and while the backend waits in vain for an answer: by the thread of the backend alone.
"""

from __future__ import annotations

from typing_extensions import override

from tests.simulators.airsim import STEP_S, Vehicle
from tests.simulators.airsim_server import AirsimServer
from ual_daemon.backends.airsim import AirsimBackend
from ual_daemon.backends.airsim.rpc import RpcConnection
from ual_daemon.backends.airsim.settings import AirsimAddress
from ual_daemon.backends.base import BackendOptions

_LOOK_S = 0.005


class SteppedConnection(RpcConnection):
    """Waits for an answer as long as the server needs for it. While the server is silent, time passes instead."""

    def __init__(self, address: AirsimAddress, server: AirsimServer) -> None:
        super().__init__(address)
        self._server = server

    @override
    def has_answer(self, number: int, timeout_s: float) -> bool:
        while not super().has_answer(number, _LOOK_S):
            if self._server.is_silent:
                self._server.run(max(timeout_s, STEP_S))
                return False
        return True


class LockstepAirsim(AirsimBackend):
    """Flies the vehicle of a server."""

    def __init__(self, options: BackendOptions, server: AirsimServer, vehicle: Vehicle) -> None:
        self._server = server
        self._vehicle = vehicle
        super().__init__(BackendOptions(options.ns, server.url, {"rate_hz": 25.0}))
        self._mailbox.put = self._sender.send  # type: ignore[method-assign]  # at its moment, and not when a thread runs

    @override
    def _connect(self, address: AirsimAddress) -> RpcConnection:
        return SteppedConnection(address, self._server)

    @override
    def _wall_s(self) -> float:
        return self._vehicle.now_s
