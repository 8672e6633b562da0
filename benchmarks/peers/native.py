"""`mavsdk`: MAVSDK's library in the process, with its synchronous interface."""

from __future__ import annotations

import time

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.offboard.offboard import Offboard, VelocityNedYaw
from mavsdk.plugins.telemetry.telemetry import Telemetry

from benchmarks.marks import number_of_distance, speed_m_s
from benchmarks.peers.base import SynchronousPeer, Times


class Peer(SynchronousPeer):
    def connect(self) -> None:
        self._mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.COMPANION_COMPUTER))
        self._mavsdk.add_any_connection(f"udpin://127.0.0.1:{self.port}")
        system = self._mavsdk.first_autopilot(30.0)
        if system is None:
            raise TimeoutError("mavsdk found no autopilot")
        self._offboard = Offboard(system)
        self._telemetry = Telemetry(system)
        self.send(0)

    def send(self, number: int) -> None:
        self._offboard.set_velocity_ned(VelocityNedYaw(speed_m_s(number), 0.0, 0.0, 0.0))

    def listen(self, subscribers_count: int, duration_s: float) -> Times:
        came = Times()

        def note(sample: object, _: object) -> None:
            came.add(number_of_distance(sample.position.north_m), time.monotonic_ns())  # type: ignore[attr-defined]

        handles = [self._telemetry.subscribe_position_velocity_ned(note) for _ in range(subscribers_count)]
        time.sleep(duration_s)
        for handle in handles:
            self._telemetry.unsubscribe_position_velocity_ned(handle)
        return came

    def close(self) -> None:
        self._mavsdk.destroy()
