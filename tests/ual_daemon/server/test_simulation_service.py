from __future__ import annotations

import asyncio
import threading
from functools import partial
from typing import Any, cast

from tests.ual_daemon.server.serving import serving
from tests.waiting import LIMIT_S
from ual.interface import Simulation
from ual.v1 import simulation_pb2 as pb
from ual.v1 import simulation_pb2_grpc
from ual_daemon.server.calls import Calls
from ual_daemon.server.services.simulation import SimulationServicer
from ual_daemon.server.transport.selection import Choice


class BlockedSimulation:
    """Whatever is done with it lasts until `go_on`, but steps."""

    def __init__(self) -> None:
        self.go_on = threading.Event()
        self.is_waiting = threading.Event()
        self.waiting: list[str] = []

    def pilot_arm(self) -> None:
        self.waiting.append(threading.current_thread().name)
        self.is_waiting.set()
        assert self.go_on.wait(LIMIT_S)

    def step(self, _: float) -> None:
        pass


def test_a_flood_of_calls_keeps_nobody_else_from_a_thread_and_steps_get_through(transport: Choice) -> None:
    async def run() -> None:
        simulation = BlockedSimulation()
        servicer = SimulationServicer(cast("Simulation", simulation))
        register = partial(simulation_pb2_grpc.add_SimulationServiceServicer_to_server, servicer)
        async with serving(transport, Calls("uav_1", shutdown_refuses=()), register) as (channel, _):
            stub: Any = simulation_pb2_grpc.SimulationServiceStub(channel)
            arming = [asyncio.ensure_future(stub.PilotArm(pb.PilotArmRequest())) for _ in range(90)]
            await asyncio.to_thread(simulation.is_waiting.wait, LIMIT_S)
            await stub.Step(pb.StepRequest(duration_s=0.1), timeout=LIMIT_S)
            await asyncio.wait_for(asyncio.to_thread(str), LIMIT_S)  # as closing a UAV and the automatic arming do
            assert len(simulation.waiting) <= 2
            simulation.go_on.set()
            await asyncio.gather(*arming)
            assert len(simulation.waiting) == 90
        servicer.close()

    asyncio.run(run())
