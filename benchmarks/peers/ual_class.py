"""UAL in the process: the class interface over the MAVLink backend."""

from __future__ import annotations

import logging

from benchmarks.peers.base import SynchronousPeer, Times, until
from benchmarks.peers.ual_samples import listen
from benchmarks.peers.ual_stream import velocity
from ual.types import State
from ual_daemon.settings import VehicleSettings
from ual_daemon.ual import UAL


class Peer(SynchronousPeer):
    settings: VehicleSettings | None = None

    def connect(self) -> None:
        logging.getLogger("ual_daemon").setLevel(logging.ERROR)
        self._uav = UAL("mavlink", "uav_1", url=f"udpin://127.0.0.1:{self.port}", settings=self.settings)
        until(lambda: self._uav.state() is State.FLYING_AUTO, "UAL flies")
        self.send(0)

    def send(self, number: int) -> None:
        self._uav.set_velocity(velocity(number))

    def listen(self, subscribers_count: int, duration_s: float) -> Times:
        return listen(self._uav, subscribers_count, duration_s)

    def close(self) -> None:
        self._uav.vehicle.close()  # at once: the vehicle of a benchmark is always safe
