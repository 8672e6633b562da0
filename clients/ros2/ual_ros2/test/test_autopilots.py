"""Autopilots that behave otherwise than a light UAV: one with parameters, and one without a safety pilot.

They are those of UAL's own tests, so these need a checkout.
"""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from conftest import ROS_ONLY, Processes, own_client, own_processes
from flying import CANCELED, Client, waited
from reading import error_of
from ros_services import Asking, Part
from ual_msgs import action, srv

import ual

ROOT = Path(__file__).parents[4]
UAL = "/uav_1/ual"
client, processes = own_client, own_processes


@contextmanager
def simulated(*words: str) -> Iterator[int]:
    """Runs a simulated autopilot, and provides the port of its link."""
    python = os.environ.get("DAEMON_PYTHON")
    if python is None or not (ROOT / "tests" / "simulators").is_dir():
        pytest.skip("no checkout of UAL with the simulated autopilots of its tests")
    environment = {name: value for name, value in os.environ.items() if name not in ROS_ONLY}
    command = [python, "-m", "tests.simulators", *words]
    with subprocess.Popen(
        command, cwd=ROOT, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as autopilot:
        assert autopilot.stdout is not None
        yield int(json.loads(autopilot.stdout.readline())["link"])
        assert autopilot.stdin is not None
        autopilot.stdin.close()


def test_parameters_are_read_and_written(client: Client, processes: Processes) -> None:
    def call(kind: Any, name: str, /, **fields: object) -> Any:
        answer = client.call(kind, f"{UAL}/{name}", **fields)
        if not answer.success:
            raise error_of(answer)
        return answer

    with simulated("px4") as port:
        processes.daemon("--url", f"udpout://127.0.0.1:{port}", backend="mavlink")
        processes.node("ns:=uav_1")
        parameters: Any = Part(Asking(client, "uav_1", call, lambda _: None), "parameters")
        waited(lambda: client.call(srv.GetParameter, f"{UAL}/get_parameter", name="COM_RC_OVERRIDE").success)
        before = parameters.get("COM_RC_OVERRIDE")
        assert before in parameters.get_all()
        with ual.Uav("uav_1") as uav:
            assert uav.parameters.get(before.name) == before
        assert parameters.set(before.name, before.value + 1).value == before.value + 1
        assert parameters.get(before.name).value == before.value + 1
        with pytest.raises(ual.InvalidArgumentError, match="value"):
            parameters.set(before.name, 0.5)
        with pytest.raises(ual.InvalidArgumentError):
            parameters.get("")


def test_without_a_safety_pilot_a_cancel_ends_a_take_off_and_a_landing(client: Client, processes: Processes) -> None:
    with simulated("crazyflie") as port, ual.Uav("uav_1") as uav:
        processes.daemon("--url", f"udp://127.0.0.1:{port}", "--auto-arm", backend="crazyflie")
        processes.node("ns:=uav_1")
        uav.wait_for(ual.State.LANDED_ARMED, timeout_s=60.0)
        for kind, name, flies in (
            (action.TakeOff, "take_off", ual.State.TAKING_OFF),
            (action.Land, "land", ual.State.LANDING),
        ):
            fields = {"height": 2.0} if kind is action.TakeOff else {}
            goal = client.begin(kind, f"{UAL}/{name}", lambda _: None, **fields)
            uav.wait_for(flies, timeout_s=60.0)
            assert client.cancel(goal)
            status, result = client.end_of(goal)
            assert (status, result.message) == (CANCELED, "cancelled: the ROS client")
            uav.wait_for(ual.State.FLYING_AUTO, timeout_s=60.0)
        assert client.call(srv.Land, f"{UAL}/land", blocking=True).success


def test_what_a_uav_carries_is_ordered_and_listed(client: Client, processes: Processes, tmp_path: Path) -> None:
    file = tmp_path / "daemon.yaml"
    file.write_text("payload: {grippers: [{name: claw}], winches: [{name: hook}], relays: [{name: lamp, number: 1}]}")
    processes.daemon("--config", str(file))
    processes.node("ns:=uav_1")
    waited(lambda: client.call(srv.MoveGripper, f"{UAL}/grip", gripper="claw").success)
    assert client.call(srv.OrderWinch, f"{UAL}/order_winch", action="HOLD").success
    assert client.call(srv.SetRelay, f"{UAL}/set_relay", state="on").success
    refused = client.call(srv.SetServo, f"{UAL}/set_servo", position="open")
    assert (refused.success, refused.reason) == (False, "INVALID_ARGUMENT")
    told = client.call(srv.ListEquipment, f"{UAL}/list_equipment").devices
    assert [(each.kind, each.name, each.ordered) for each in told] == [
        ("gripper", "claw", "grip"),
        ("winch", "hook", "hold"),
        ("relay", "lamp", "on"),
    ]
    assert told[2].state == "on"
