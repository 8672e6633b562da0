"""What a UAV has beside flying, by ROS only: the part of `ros_uav.RosUav` that each service has a module for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flying import Client
from ros_cameras import RosCameras
from ros_corrections import RosCorrections
from ros_equipment import RosGripper
from ros_fence import RosFence
from ros_gimbals import RosGimbals
from ros_logs import RosLogs
from ros_mission import RosMission
from ros_simulation import RosSimulation

import ual


class Beside:
    """The services beside flying of one UAV.

    Args:
        client: The program in ROS.
        ns: The name of the UAV.
        call: Calls a service of it.
        trigger: Calls one that has no request.
        fly: Begins to fly the mission that its autopilot has.
        error_of: Reads the error of an answer or result.

    """

    def __init__(
        self,
        client: Client,
        ns: str,
        call: Callable[..., Any],
        trigger: Callable[[str], None],
        fly: Callable[[dict[str, Any]], ual.TaskInfo],
        error_of: Callable[[Any], ual.UalError],
    ) -> None:
        self.cameras = RosCameras(call)
        self.corrections = RosCorrections(client, ns, call)
        self.fence = RosFence(call)
        self.gimbals = RosGimbals(client, ns, call)
        self.gripper = RosGripper(call)
        self.logs = RosLogs(client, ns, call, error_of)
        self.mission = RosMission(client, ns, call, trigger, fly)
        self.simulation = RosSimulation(call, trigger, client.node.get_clock())
