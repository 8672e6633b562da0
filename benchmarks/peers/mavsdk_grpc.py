"""`mavsdk-grpc`: MAVSDK's server with its own Python client, which uses asyncio."""

from __future__ import annotations

import asyncio
import time

from mavsdk_grpc import System
from mavsdk_grpc.offboard import VelocityNedYaw

from benchmarks.marks import number_of_distance, speed_m_s
from benchmarks.peers import base
from benchmarks.peers.base import Times


class Peer(base.Peer):
    def connect(self) -> None:
        self._loop = asyncio.new_event_loop()
        host, _, port = self.address.rpartition(":")
        self._system = System(host, int(port))
        self._loop.run_until_complete(self._connect())

    async def _connect(self) -> None:
        await self._system.connect()
        async for state in self._system.core.connection_state():
            if state.is_connected:
                break
        await self._send(0)

    async def _send(self, number: int) -> None:
        await self._system.offboard.set_velocity_ned(VelocityNedYaw(speed_m_s(number), 0.0, 0.0, 0.0))

    def pace(self, first: int, count: int, rate_hz: float) -> Times:
        async def run() -> Times:
            given = Times()
            due_s = time.monotonic()
            for number in range(first, first + count):
                due_s += 1.0 / rate_hz
                await asyncio.sleep(max(0.0, due_s - time.monotonic()))
                given.add(number, time.monotonic_ns())
                await self._send(number)
            return given

        return self._loop.run_until_complete(run())

    def flood(self, first: int, duration_s: float) -> int:
        async def run() -> int:
            number, ends_s = first, time.monotonic() + duration_s
            while time.monotonic() < ends_s:
                await self._send(number)
                number += 1
            return number - first

        return self._loop.run_until_complete(run())

    def listen(self, subscribers_count: int, duration_s: float) -> Times:
        came = Times()

        async def subscriber() -> None:
            async for sample in self._system.telemetry.position_velocity_ned():
                came.add(number_of_distance(sample.position.north_m), time.monotonic_ns())

        async def run() -> None:
            tasks = [asyncio.create_task(subscriber()) for _ in range(subscribers_count)]
            await asyncio.wait(tasks, timeout=duration_s)
            for task in tasks:
                task.cancel()
            await asyncio.wait(tasks)

        self._loop.run_until_complete(run())
        return came

    def close(self) -> None:
        self._loop.close()
