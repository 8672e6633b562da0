"""`ual teleop joystick` with SDL's virtual devices: only what is held flies, and a pulled cable stops."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner

import ual
from tests.conftest import LIMIT_S, DaemonProcess
from tests.ual.joystick.virtual import VirtualDevice, require_pygame, virtual_devices
from tests.ual_tools.test_teleop_pilot import PERIOD_S, Flight
from tests.waiting import until
from ual.geometry import Twist, Vector3
from ual.joystick import Button, Joysticks
from ual.types import State
from ual_tools.main import cli
from ual_tools.teleop.actions import Action
from ual_tools.teleop.joystick import JoystickControls
from ual_tools.teleop.layout import Layout
from ual_tools.teleop.pilot import Pilot
from ual_tools.teleop.vehicle import TeleopVehicle

require_pygame()

NUMBERS = {button: number for number, button in enumerate(Button)}
FORWARD_AXIS, LEFT_AXIS = 3, 2


class Bench(Flight):
    """A pilot and a gamepad, on a clock of the test."""

    def __init__(self, joysticks: Joysticks, connect: Callable[[], VirtualDevice]) -> None:
        super().__init__(count=2)
        self._connect = connect
        self.device = connect()
        self.controls = JoystickControls(joysticks, joysticks.find(), Layout())

    def pass_s(self, duration_s: float = PERIOD_S, read: bytes = b"", *, is_late: bool = False) -> None:
        for _ in range(max(1, round(duration_s / PERIOD_S))):
            self.now_s += PERIOD_S
            self._refresh()
            self.controls.control(self.pilot, read, self.now_s, is_late=is_late)
            read = b""

    def hold(self, *buttons: Button, is_held: bool = True) -> None:
        for button in buttons:
            self.device.button(NUMBERS[button], is_held)

    def fly(self) -> None:
        """Centred, then forward with the dead-man's button."""
        self.pass_s()
        self.hold(Button.LEFT_SHOULDER)
        self.device.axis(FORWARD_AXIS, -1.0)
        self.pass_s(0.2)
        assert self.twists()[-1] == Twist(Vector3(0.5, 0.0, 0.0))

    def flies(self) -> bool:
        """Returns whether anything but zero is sent from now on."""
        self.sent.clear()
        self.pass_s(1.0)
        return any(twist != Twist() for twist in self.twists())


@pytest.fixture
def joysticks() -> Iterator[Joysticks]:
    with Joysticks() as opened:
        yield opened


@pytest.fixture
def bench(joysticks: Joysticks) -> Iterator[Bench]:
    with virtual_devices() as connect:
        bench = Bench(joysticks, connect)
        yield bench
        bench.controls.close()


def test_nothing_is_sent_until_something_is_touched(bench: Bench) -> None:
    bench.pass_s(5.0)
    assert (bench.sent, bench.vehicles[0].commands) == ([], [])


def test_only_what_is_held_flies(bench: Bench) -> None:
    bench.pass_s()
    bench.device.axis(FORWARD_AXIS, -1.0)
    assert not bench.flies()
    bench.device.axis(FORWARD_AXIS, 0.0)
    bench.fly()
    bench.hold(Button.LEFT_SHOULDER, is_held=False)
    assert not bench.flies()


def test_a_stick_that_is_not_centred_at_the_start_does_nothing(bench: Bench) -> None:
    bench.device.axis(FORWARD_AXIS, -1.0)
    bench.hold(Button.LEFT_SHOULDER)
    assert not bench.flies()
    assert bench.controls.question(bench.now_s) == "let go of all sticks and buttons"
    bench.device.axis(FORWARD_AXIS, 0.0)
    bench.hold(Button.LEFT_SHOULDER, is_held=False)
    bench.fly()
    assert bench.controls.question(bench.now_s) == ""


def test_a_pulled_cable_stops_and_what_is_held_when_it_is_back_does_nothing(bench: Bench) -> None:
    bench.fly()
    bench.device.pull()
    assert not bench.flies()
    assert "was disconnected: connect it again" in bench.controls.question(bench.now_s)
    assert "was disconnected" in bench.vehicles[0].refusal.text
    bench.device = bench._connect()
    bench.hold(Button.LEFT_SHOULDER)
    bench.device.axis(FORWARD_AXIS, -1.0)
    bench.pass_s(2.0)
    assert not bench.flies()
    bench.hold(Button.LEFT_SHOULDER, is_held=False)
    bench.device.axis(FORWARD_AXIS, 0.0)
    bench.fly()


def test_two_buttons_take_off_once_and_one_does_not(bench: Bench) -> None:
    bench.pass_s()
    bench.hold(Button.Y)
    bench.pass_s(1.0)
    assert bench.vehicles[0].commands == []
    bench.hold(Button.RIGHT_SHOULDER)
    bench.pass_s(3.0)
    assert bench.vehicles[0].commands == ["take-off"]


def test_buttons_that_are_held_at_the_start_ask_for_nothing(bench: Bench) -> None:
    bench.hold(Button.Y, Button.RIGHT_SHOULDER)
    bench.pass_s(1.0)
    assert bench.vehicles[0].commands == []


def test_late_buttons_and_keys_only_end_a_motion(bench: Bench) -> None:
    bench.pass_s()
    bench.hold(Button.Y, Button.RIGHT_SHOULDER)
    bench.pass_s(read=b"\t", is_late=True)
    assert bench.vehicles[0].commands == []
    bench.pass_s(read=b" ", is_late=True)
    assert [vehicle.commands for vehicle in bench.vehicles] == [[Action.STOP.value], []]


def test_headless_is_along_east_and_north_and_the_next_uav_is_chosen(bench: Bench) -> None:
    bench.pass_s()
    bench.hold(Button.BACK)
    bench.pass_s()
    bench.hold(Button.BACK, is_held=False)
    bench.hold(Button.LEFT_SHOULDER)
    bench.device.axis(FORWARD_AXIS, -1.0)
    bench.pass_s(0.2)
    assert bench.twists()[-1] == Twist(Vector3(0.0, 0.5, 0.0))
    bench.hold(Button.DPAD_RIGHT)
    bench.pass_s()
    assert bench.pilot.vehicle is bench.vehicles[1]


def test_a_light_uav_is_executed_and_stands_after_the_cable_was_pulled(
    daemon: DaemonProcess, joysticks: Joysticks
) -> None:
    with virtual_devices() as connect, ual.Uav(daemon.ns) as uav:
        uav.wait_for(State.LANDED_ARMED, timeout_s=LIMIT_S)
        uav.take_off(2.0)
        device = connect()
        vehicle = TeleopVehicle(ual.Uav(daemon.ns), daemon.ns)
        vehicle.open()
        controls, pilot = JoystickControls(joysticks, joysticks.find(), Layout()), Pilot([vehicle], 2.0)

        def control() -> None:
            controls.control(pilot, b"", time.monotonic(), is_late=False)
            time.sleep(PERIOD_S)  # at the teleop's rate

        def fly_until(condition: Callable[[], bool]) -> None:
            until(condition, seen=uav.telemetry, between=control)

        fly_until(lambda: vehicle.telemetry is not None and not controls.question(0.0))
        device.button(NUMBERS[Button.LEFT_SHOULDER], True)
        device.axis(FORWARD_AXIS, -1.0)
        begin = uav.pose().pose.position
        fly_until(lambda: (uav.pose().pose.position - begin).norm() > 1.0)
        device.pull()
        fly_until(lambda: uav.velocity().twist.linear.norm() < 0.02)
        assert uav.state() is State.FLYING_AUTO
        vehicle.close()
        controls.close()


def test_without_a_joystick_the_command_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("UAL_NS", raising=False)
    result = CliRunner().invoke(cli, ["teleop", "joystick"])
    assert (result.exit_code, result.stderr) == (1, "ual: no joystick is connected\n")
    listed = CliRunner().invoke(cli, ["teleop", "joystick", "--list"])
    assert (listed.exit_code, listed.stdout, listed.stderr) == (0, "", "no joystick is connected\n")


def test_a_wrong_file_is_wrong_usage(tmp_path: Path) -> None:
    file = tmp_path / "joystick.yaml"
    file.write_text("hold: shoulder", encoding="utf-8")
    result = CliRunner().invoke(cli, ["teleop", "joystick", "--config", str(file)])
    assert result.exit_code == 2
    assert "joystick.yaml:1: hold: expected" in result.stderr


@pytest.mark.parametrize(
    ("package", "words", "extra"),
    [("pygame", [], "ual-client[joystick]"), ("yaml", ["--config", "any.yaml"], "ual-tools[joystick]")],
)
def test_a_package_that_is_missing_is_named_with_its_extra(
    package: str, words: list[str], extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [
        name for name in sys.modules if name.startswith(("ual_tools.strict_yaml.nodes", "ual_tools.teleop.layout_file"))
    ]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    result = CliRunner().invoke(cli, ["teleop", "joystick", *words])
    assert result.exit_code == 1
    assert f"pip install '{extra}'" in result.stderr
