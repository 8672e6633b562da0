"""The world around one vehicle, as far as the simulator offers it: the pilot, time, wind, and a place on the ground."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import TimeoutError as NotInTime

from typing_extensions import override

from ual.errors import LinkLostError, NotSupportedError, RejectedByAutopilotError, WrongStateError
from ual.geometry import Vector3
from ual.interface import Simulation
from ual.simulation import SimulationPart
from ual_daemon import validation
from ual_daemon.backends.airsim.commands import Action
from ual_daemon.backends.airsim.pilot import AirsimPilot, RcSticks
from ual_daemon.backends.airsim.procedures import Procedures
from ual_daemon.backends.airsim.rpc import RpcCaller
from ual_daemon.backends.airsim.session import AirsimSession
from ual_daemon.backends.airsim.state import AirsimReport

_ACTION_S = 10.0
_POLL_PERIOD_S = 0.02
_ARRIVAL_DISTANCE_M = 0.5
_PARTS = frozenset({SimulationPart.PILOT, SimulationPart.TIME, SimulationPart.WIND, SimulationPart.PLACE})


class AirsimSimulation(Simulation):
    """See `ual.interface.Simulation`. Each member waits until its effect is seen."""

    def __init__(self, session: AirsimSession, procedures: Procedures, pilot: AirsimPilot) -> None:
        self._session = session
        self._procedures = procedures
        self._pilot = pilot

    @override
    def parts(self) -> frozenset[SimulationPart]:
        return _PARTS

    @override
    def pilot_arm(self) -> None:
        self._require_ground("arm")
        self._do(self._procedures.arm)
        self._wait(lambda report: report.is_armed, "armed")

    @override
    def pilot_disarm(self) -> None:
        self._require_ground("disarm")
        self._do(self._procedures.disarm)
        self._wait(lambda report: not report.is_armed, "disarmed")

    @override
    def pilot_take_over(self) -> None:
        self._do(self._pilot.take_over)
        self._wait(lambda report: not report.has_api_control, "flown by the pilot")

    @override
    def pilot_move_sticks(self, *, forward: float = 0.0, left: float = 0.0, up: float = 0.0, turn: float = 0.0) -> None:
        sticks = RcSticks(
            validation.number(forward, "forward", at_most=1.0),
            validation.number(left, "left", at_most=1.0),
            validation.number(up, "up", at_most=1.0),
            validation.number(turn, "turn", at_most=1.0),
        )
        if not self._pilot.is_flying:
            raise WrongStateError("the safety pilot does not fly: the pilot must take over first")
        self._pilot.sticks = sticks

    @override
    def pilot_give_back(self) -> None:
        self._do(self._procedures.take_control)
        self._wait(lambda report: report.has_api_control, "under API control")
        self._pilot.let_go()

    @override
    def set_speed_factor(self, speed_factor: float) -> None:
        """Pauses the simulator (0), or lets it run on at its own speed, for all its vehicles."""
        own = self._session.own_speed
        if speed_factor not in (0.0, own):
            raise NotSupportedError(
                f"the simulator's time runs {own:g} times as fast as real time (ClockSpeed in settings.json) or "
                "stands still (0)"
            )
        self._do(lambda connection: self._procedures.pause(connection, speed_factor == 0.0))

    @override
    def step(self, duration_s: float) -> None:
        validation.not_negative(duration_s, "duration_s", at_most=3600.0)
        paused: list[bool] = []
        self._do(lambda connection: paused.append(self._procedures.is_paused(connection)))
        if not paused[0]:
            raise WrongStateError("simulated time runs by itself: set the speed factor 0 before")
        self._do(lambda connection: self._procedures.step(connection, duration_s), _ACTION_S + 20.0 * duration_s)

    @override
    def set_wind(self, velocity_m_s: Vector3) -> None:
        """Sets a steady wind for all vehicles of the simulator, along the axes of `map`."""
        wind = validation.vector(velocity_m_s, "velocity_m_s", at_most=100.0)
        self._do(lambda connection: self._procedures.set_wind(connection, wind))

    @override
    def place_on_ground(self, position: Vector3, yaw_rad: float = 0.0) -> None:
        wanted = validation.position(position, "position")
        yaw_rad = validation.heading(yaw_rad, "yaw_rad")

        def put(connection: RpcCaller) -> None:
            self._procedures.put_on_ground(connection, wanted, yaw_rad)

        def is_there(report: AirsimReport) -> bool:
            is_near = (report.pose.position - wanted).horizontal_norm() < _ARRIVAL_DISTANCE_M
            return is_near and not report.is_armed and self._session.is_on_ground

        with self._session.without_setpoints():  # a velocity that holds where it was would start the motors again
            self._do(put)
            self._wait(is_there, "placed")

    def _require_ground(self, what: str) -> None:
        if not self._session.is_on_ground:
            raise RejectedByAutopilotError(f"the safety pilot does not {what} a vehicle that is not on the ground")

    def _do(self, action: Action, patience_s: float = _ACTION_S) -> None:
        """Executes a command, and waits for its end.

        Raises:
            RejectedByAutopilotError: The simulator refused.
            LinkLostError: It does not answer.
        """
        try:
            self._session.execute(action).result(patience_s)
        except NotInTime:
            raise LinkLostError("the simulator does not answer") from None

    def _wait(self, condition: Callable[[AirsimReport], bool], what: str) -> None:
        deadline_s = time.monotonic() + _ACTION_S
        while (report := self._session.report) is None or not condition(report):
            if time.monotonic() > deadline_s:
                raise LinkLostError(f"the vehicle was not {what} within {_ACTION_S:g} s")
            time.sleep(_POLL_PERIOD_S)
