"""`ual gripper`, the clients and the service, with a daemon of a light UAV."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import ual
from tests.conftest import DaemonProcess, StartDaemon
from tests.waiting import until
from ual.errors import InvalidArgumentError, NotSupportedError
from ual.gripper import GripperState, WinchAction
from ual_tools.main import cli

PAYLOAD = """
payload:
  grippers: [{name: claw}]
  winches: [{name: hook, longest_m: 20, fastest_m_s: 1}]
  servos: [{name: door, channel: 9, min_pwm_us: 1000, max_pwm_us: 2000, positions: {open: 1100, closed: 1900}}]
  relays: [{name: lamp, number: 1, on_name: lit, off_name: dark}]
light: {speed_factor: 20}
"""


@pytest.fixture
def daemon(start_daemon: StartDaemon, tmp_path: Path) -> DaemonProcess:
    file = tmp_path / "daemon.yaml"
    file.write_text(PAYLOAD)
    return start_daemon("--config", str(file), backend="light")


def run(daemon: DaemonProcess, *words: str) -> Result:
    return CliRunner().invoke(cli, ["--address", daemon.address, *words])


def done(daemon: DaemonProcess, *words: str) -> str:
    result = run(daemon, *words)
    assert result.exit_code == 0, result.output
    return result.stdout


def test_the_command_does_all(daemon: DaemonProcess) -> None:
    done(daemon, "gripper", "grip")
    done(daemon, "gripper", "winch", "length", "--length", "2")
    done(daemon, "gripper", "servo", "closed")
    done(daemon, "gripper", "servo", "--pwm", "1900")
    done(daemon, "gripper", "relay", "lit", "--name", "lamp")
    with ual.Uav(address=daemon.address) as uav:
        until(lambda: uav.gripper.get_all().winches[0].status.length_m == 2.0)  # type: ignore[union-attr]
        until(lambda: uav.gripper.get_all().servos[0].position == "closed")
    found = json.loads(done(daemon, "--json", "gripper", "list"))
    assert found["grippers"] == [{"name": "claw", "state": "CLOSED", "ordered": "grip", "note": ""}]
    assert found["relays"][0]["is_on"] is True
    table = done(daemon, "gripper", "list")
    for words in ("closed", "2.0 m out", "closed (1900 us)", "lit", "length 2 m"):
        assert words in table
    done(daemon, "gripper", "release", "claw")
    refused = run(daemon, "gripper", "servo", "--pwm", "2001")
    assert refused.exit_code == 1
    assert "2001 is not from 1000 to 2000, the bounds of door" in refused.output


def test_the_client_and_its_twin(daemon: DaemonProcess) -> None:
    async def order() -> GripperState:
        async with ual.aio.Uav(address=daemon.address) as uav:
            await uav.gripper.grip("claw")
            await uav.gripper.order_winch(WinchAction.RATE, rate_m_s=0.5)
            await uav.gripper.order_winch(WinchAction.HOLD, winch="hook")
            return (await uav.gripper.get_all()).grippers[0].state

    assert asyncio.run(order()) in (GripperState.CLOSING, GripperState.CLOSED)
    with ual.Uav(address=daemon.address) as uav:
        orders: list[Callable[[], None]] = [
            lambda: uav.gripper.grip("hand"),
            lambda: uav.gripper.order_winch("hold"),  # type: ignore[arg-type]  # what a program may pass
            lambda: uav.gripper.set_servo(pwm_us=-1),
            lambda: uav.gripper.set_relay(1),  # type: ignore[arg-type]  # as above
        ]
        for wrong in orders:
            with pytest.raises(InvalidArgumentError):
                wrong()
        with pytest.raises(NotSupportedError, match="cannot DELIVER"):
            uav.gripper.order_winch(WinchAction.DELIVER)


def test_the_class_has_what_the_daemon_has() -> None:
    from ual_daemon import UAL
    from ual_daemon.settings import PayloadSettings, RelaySettings, VehicleSettings

    settings = VehicleSettings(payload=PayloadSettings(relays=(RelaySettings(name="lamp", number=1),)))
    with UAL(backend="light", settings=settings) as uav:
        uav.gripper.set_relay("on")
        assert uav.gripper.get_all().relays[0].is_on is True
