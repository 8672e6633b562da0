"""The world around a simulated UAV by the services of the node."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import Point, Vector3
from ual_msgs import msg, srv

import ual
from ual.interface import Simulation
from ual.simulation import Fault, SimulationPart
from ual_ros2 import values
from ual_ros2.beside import simulation
from ual_ros2.beside.filling import Filling
from ual_ros2.ros_time import RosTime

Call = Callable[..., Any]


class RosSimulation(Simulation):
    """The world of one UAV."""

    def __init__(self, call: Call, trigger: Callable[[str], None], clock: Any) -> None:
        self._call = call
        self._trigger = trigger
        self._filling = Filling(RosTime(clock))

    def parts(self) -> frozenset[SimulationPart]:
        listed = self._call(srv.ListSimulationParts, "simulation/list_parts").parts
        return frozenset(SimulationPart[each] for each in listed)

    def pilot_arm(self) -> None:
        self._trigger("simulation/pilot_arm")

    def pilot_disarm(self) -> None:
        self._trigger("simulation/pilot_disarm")

    def pilot_take_over(self) -> None:
        self._trigger("simulation/pilot_take_over")

    def pilot_move_sticks(self, *, forward: float = 0.0, left: float = 0.0, up: float = 0.0, turn: float = 0.0) -> None:
        given = {"forward": forward, "left": left, "up": up, "turn": turn}
        self._call(srv.MoveSticks, "simulation/pilot_move_sticks", **given)

    def pilot_give_back(self) -> None:
        self._trigger("simulation/pilot_give_back")

    def begin_fault(self, fault: Fault, duration_s: float = 0.0) -> str:
        message = self._filling.filled(msg.Fault(), simulation.fault_fields(fault))
        answer = self._call(srv.BeginFault, "simulation/begin_fault", fault=message, duration=duration_s)
        return str(answer.fault_id)

    def end_fault(self, fault_id: str = "") -> None:
        self._call(srv.EndFault, "simulation/end_fault", fault_id=fault_id)

    def faults(self) -> dict[str, Fault]:
        listed = self._call(srv.ListFaults, "simulation/list_faults").faults
        return {each.fault_id: simulation.fault(each) for each in listed}

    def set_speed_factor(self, speed_factor: float) -> None:
        self._call(srv.SetSpeedFactor, "simulation/set_speed_factor", speed_factor=speed_factor)

    def step(self, duration_s: float) -> None:
        self._call(srv.StepTime, "simulation/step", duration=duration_s)

    def set_noise(self, *, position_m: float, velocity_m_s: float) -> None:
        self._call(srv.SetNoise, "simulation/set_noise", position=position_m, velocity=velocity_m_s)

    def set_wind(self, velocity_m_s: ual.Vector3) -> None:
        message = Vector3()
        values.fill_vector(message, velocity_m_s)
        self._call(srv.SetWind, "simulation/set_wind", velocity=message)

    def place_on_ground(self, position: ual.Vector3, yaw_rad: float = 0.0) -> None:
        message = Point()
        values.fill_vector(message, position)
        self._call(srv.PlaceOnGround, "simulation/place_on_ground", position=message, yaw=yaw_rad)
