"""Parameters that are wrong, late or unknown, and the lifecycle's ends: what a user is told by ROS' own tools."""

from __future__ import annotations

import asyncio
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest
from conftest import Processes, own_client, own_processes
from flying import Client, waited
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.lifecycle import TransitionCallbackReturn

from ual_ros2 import node

client, processes = own_client, own_processes


def is_in(client: Client, state: str) -> None:
    """Waits until the node is in a state of the lifecycle."""
    waited(lambda: client.call_again(GetState, "/ual/get_state").current_state.label == state)


def change(client: Client, transition: int) -> bool:
    """Lets the node change its state of the lifecycle; returns whether it has."""
    return bool(client.call(ChangeState, "/ual/change_state", transition=Transition(id=transition)).success)


def names_below(client: Client, prefix: str) -> list[str]:
    """The topics and services of all nodes below a name."""
    found = (*client.node.get_topic_names_and_types(), *client.node.get_service_names_and_types())
    return [name for name, _ in found if name.startswith(prefix)]


def set_rate(client: Client, rate_hz: float) -> tuple[bool, str]:
    """Does what ``ros2 param set /ual rate_hz`` does."""
    value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=rate_hz)
    wanted = Parameter(name="rate_hz", value=value)
    [result] = client.call(SetParameters, "/ual/set_parameters", parameters=[wanted]).results
    return result.successful, result.reason


def test_a_parameter_is_set_before_the_node_is_configured_and_only_a_right_one(
    client: Client, processes: Processes
) -> None:
    processes.node("ns:=uav_1", "rate_hz:=50")  # a whole number is a rate, too
    is_in(client, "active")
    is_set, reason = set_rate(client, 20.0)
    assert not is_set
    assert "rate_hz is read when the node is configured: `ros2 lifecycle set` it to deactivate and cleanup" in reason
    assert change(client, Transition.TRANSITION_DEACTIVATE)
    assert change(client, Transition.TRANSITION_CLEANUP)
    assert set_rate(client, -3.0) == (False, "rate_hz: -3.0 is not a rate of 0 to 1000 Hz")
    assert set_rate(client, 20.0) == (True, "")
    assert change(client, Transition.TRANSITION_CONFIGURE)


def test_what_rclpy_refuses_is_reported_and_leaves_the_node_unconfigured(client: Client, processes: Processes) -> None:
    of_topic = "qos_overrides./uav_1/ual/corrections.subscription"  # one of the last that are made
    processes.node("ns:=uav_1", "rate:=3.0", f"{of_topic}.reliability:=best")
    waited(lambda: "on_configure failed: RuntimeError: Unexpected QoS override" in processes.status_text())
    assert "there is no parameter rate: do you mean rate_hz?" in processes.status_text()
    is_in(client, "unconfigured")
    waited(lambda: not names_below(client, "/uav_1/ual/"))


class WithoutRos(node.UalNode):
    """A node of which only what it does with its UAVs is used."""

    def __init__(self, loop: asyncio.AbstractEventLoop, uavs: Iterable[Any], warn: Callable[[str], object]) -> None:
        self._loop, self._shared, self._uavs = loop, None, {str(number): uav for number, uav in enumerate(uavs)}
        self._log = SimpleNamespace(warning=warn)

    def get_logger(self) -> Any:
        return self._log


def test_a_node_whose_daemon_does_not_answer_its_goodbye_is_cleaned_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(node, "ENDING_S", 0.01)
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever)
    thread.start()
    closing = [threading.Event(), threading.Event()]

    async def close(is_closing: threading.Event) -> None:
        is_closing.set()
        await asyncio.Event().wait()

    hung = [SimpleNamespace(destroy=lambda: None, close=partial(close, each)) for each in closing]
    told: list[str] = []
    assert WithoutRos(loop, hung, told.append).on_cleanup(None) is TransitionCallbackReturn.SUCCESS
    assert told == ["a daemon has not answered within 0.01 s"]
    waited(lambda: all(each.is_set() for each in closing))
    loop.call_soon_threadsafe(loop.stop)
    thread.join()


def test_a_file_that_is_not_there_is_reported_by_the_node(client: Client, processes: Processes) -> None:
    node = processes.node("ns:=uav_1", "autostart:=false", "tls_ca:=/nowhere")
    is_in(client, "unconfigured")
    assert not change(client, Transition.TRANSITION_CONFIGURE)
    assert "not configured: INVALID_ARGUMENT: tls_ca: cannot read /nowhere" in processes.status_text()
    assert node.poll() is None


def test_a_node_that_was_shut_down_ends_at_ctrl_c(client: Client, processes: Processes) -> None:
    node = processes.node("ns:=uav_1")
    is_in(client, "active")
    assert change(client, Transition.TRANSITION_ACTIVE_SHUTDOWN)
    is_in(client, "finalized")
    node.send_signal(signal.SIGINT)
    assert node.wait(60.0) == 0


@pytest.mark.parametrize(
    ("wrong", "said"),
    [(["nonsense"], "nonsense"), (["--params-file", "/nowhere.yaml"], "/nowhere.yaml")],
)
def test_arguments_that_are_wrong_end_it_with_one_message(wrong: list[str], said: str) -> None:
    command = [sys.executable, "-m", "ual_ros2", "--ros-args", *wrong]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=60.0)
    assert done.returncode == 1
    assert "ual_ros2: its arguments are wrong: " in done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr
