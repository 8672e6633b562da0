"""`SimulationService`: the world around a simulated vehicle. Offered by simulated backends only."""

from __future__ import annotations

import asyncio
import contextvars
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from functools import partial
from typing import Protocol, TypeVar

from typing_extensions import override

from ual.interface import Simulation
from ual.v1 import simulation_pb2 as pb
from ual.v1 import simulation_pb2_grpc

T = TypeVar("T")

_ACTIONS_AT_ONCE = 2
_SLICE_S = 1.0
_LONGEST_COMMANDED_STEP_S = 3600.0


class SimulatedTime(Protocol):
    """The time of one or more simulations; see `ual.interface.Simulation`. Its members may block."""

    def set_speed_factor(self, speed_factor: float) -> None:
        """Sets how fast it runs."""

    def step(self, duration_s: float) -> None:
        """Advances it while it stands still."""


class SimulationServicerBase(simulation_pb2_grpc.SimulationServiceServicer):
    """The threads of one simulation's methods, and those methods that change its time.

    The members of a simulation may block (a step, the pilot's switches), so each runs on a worker thread of this
    service. Many calls wait for each other, and for nothing else of the daemon. Steps have a thread of their own,
    because the pilot's actions may wait for simulated time.
    """

    def __init__(self, simulation: Simulation, time: SimulatedTime | None = None) -> None:
        """`time` is changed in its stead, for UAVs that share their time with those of other processes."""
        self._simulation = simulation
        self._time = simulation if time is None else time
        self._stepper = ThreadPoolExecutor(1, "simulated time")
        self._actors = ThreadPoolExecutor(_ACTIONS_AT_ONCE, "simulated pilot")

    def close(self) -> None:
        """Lets the threads end. Actions that have not begun are dropped."""
        for each in (self._stepper, self._actors):
            each.shutdown(wait=False, cancel_futures=True)

    async def _act(self, action: Callable[..., T], *arguments: object, **named: object) -> T:
        return await _on(self._actors, partial(action, *arguments, **named))

    async def _step(self, step: Callable[[float], None], duration_s: float) -> None:
        await _on(self._stepper, partial(step, duration_s))

    @override
    async def ListParts(self, request: pb.ListPartsRequest, context: object) -> pb.ListPartsResponse:
        parts = sorted(each.value for each in self._simulation.parts())
        return pb.ListPartsResponse(parts=[pb.SimulationPart.ValueType(each) for each in parts])

    @override
    async def SetSpeedFactor(self, request: pb.SetSpeedFactorRequest, context: object) -> pb.SetSpeedFactorResponse:
        await self._act(self._time.set_speed_factor, request.speed_factor)
        return pb.SetSpeedFactorResponse()

    @override
    async def Step(self, request: pb.StepRequest, context: object) -> pb.StepResponse:
        # A thread cannot be interrupted: slices let a step end with its caller, or with the daemon. A duration that is
        # not allowed is passed on as it is, to be refused.
        left_s = request.duration_s
        while 2.0 * _SLICE_S < left_s <= _LONGEST_COMMANDED_STEP_S:
            await self._step(self._time.step, _SLICE_S)
            left_s -= _SLICE_S
        await self._step(self._time.step, left_s)
        return pb.StepResponse()


async def _on(workers: Executor, action: Callable[[], T]) -> T:
    """Runs it on a worker, with the caller's address for the log."""
    run = contextvars.copy_context().run
    return await asyncio.get_running_loop().run_in_executor(workers, run, action)
