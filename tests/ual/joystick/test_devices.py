"""Step one: what a device says becomes SDL's standard layout. Driven by SDL's virtual devices."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.ual.joystick.virtual import VirtualDevice, require_pygame, virtual_devices
from ual.errors import NotSupportedError
from ual.joystick import (
    Axis,
    Button,
    GamepadState,
    JoystickDisconnectedError,
    JoystickError,
    Joysticks,
    Mapping,
    MappingError,
    mapping_directory,
)

require_pygame()

Connect = Callable[..., VirtualDevice]


@pytest.fixture
def joysticks(tmp_path: Path) -> Iterator[Joysticks]:
    with Joysticks(tmp_path) as opened:
        yield opened


@pytest.fixture
def connect(joysticks: Joysticks) -> Iterator[Connect]:  # noqa: ARG001 (ends after the devices)
    with virtual_devices() as connect:
        yield connect


def test_a_gamepad_that_sdl_knows_needs_no_file(joysticks: Joysticks, connect: Connect) -> None:
    device = connect()
    with joysticks.open() as gamepad:
        assert gamepad.device.is_mapped
        assert gamepad.read() == GamepadState()
        for number, value in enumerate((-1.0, 1.0, 0.5, -0.5)):
            device.axis(number, value)
        device.axis(4, 1.0)
        device.button(0, True)
        device.button(14, True)
        read = gamepad.read()
        assert [round(read.axis(axis), 3) for axis in Axis] == [-1.0, 1.0, 0.5, -0.5, 1.0, 0.0]
        assert read.pressed == {Button.A, Button.DPAD_RIGHT}
        device.button(0, False)
        assert gamepad.read().pressed == {Button.DPAD_RIGHT}


def test_each_button_has_its_name(joysticks: Joysticks, connect: Connect) -> None:
    device = connect()
    with joysticks.open() as gamepad:
        for number, button in enumerate(Button):
            device.button(number, True)
            assert gamepad.read().pressed == {button}
            device.button(number, False)


def test_a_pulled_cable_is_an_error_and_the_device_can_be_opened_again(joysticks: Joysticks, connect: Connect) -> None:
    device = connect()
    with joysticks.open() as gamepad:
        device.axis(0, 1.0)
        assert gamepad.read().left_x == 1.0
        device.pull()
        assert not gamepad.is_connected
        with pytest.raises(JoystickDisconnectedError, match="Virtual Controller was disconnected"):
            gamepad.read()
    with pytest.raises(JoystickError, match="no joystick is connected"):
        joysticks.open()
    connect()
    with joysticks.open() as gamepad:
        assert gamepad.read() == GamepadState()


def test_one_of_several_is_chosen_by_number_or_name(joysticks: Joysticks, connect: Connect) -> None:
    connect()
    connect(is_gamepad=False)
    assert [device.is_mapped for device in joysticks.list()] == [True, False]
    with pytest.raises(JoystickError, match=r"one of several joysticks: choose one of 0 \(Virtual Controller\), 1 \(V"):
        joysticks.find()
    assert joysticks.find(1).name == "Virtual Joystick"
    assert joysticks.find("controller").index == 0
    with pytest.raises(JoystickError, match="'xbox' is none of the joysticks"):
        joysticks.find("xbox")
    with pytest.raises(JoystickError, match="are not known: ual teleop joystick --map"):
        joysticks.open(1)


def test_a_device_that_sdl_does_not_know_is_known_by_a_file(tmp_path: Path) -> None:
    with Joysticks(tmp_path) as joysticks, virtual_devices() as connect:
        connect(is_gamepad=False, axes=4, buttons=6, hats=1)
        device = joysticks.find()
    bindings = {"leftx": "a1~", "lefttrigger": "+a2", "righttrigger": "b5", "a": "b3", "dpup": "h0.1"}
    Mapping(device.guid, "My stick, the old one", bindings).save(tmp_path)
    with Joysticks(tmp_path) as joysticks, virtual_devices() as connect:
        stick = connect(is_gamepad=False, axes=4, buttons=6, hats=1)
        with joysticks.open() as gamepad:
            assert gamepad.read() == GamepadState(left_x=-1 / 32767)  # SDL inverts 0 to -1
            stick.axis(1, -1.0)
            stick.axis(2, 1.0)
            stick.button(3, True)
            stick.button(5, True)
            stick.hat(0, 1)
            pressed = frozenset({Button.A, Button.DPAD_UP})
            assert gamepad.read() == GamepadState(
                left_x=32766 / 32767, left_trigger=1.0, right_trigger=1.0, pressed=pressed
            )


@pytest.mark.parametrize(
    ("line", "error"),
    [
        ("03000000,A stick,a:b0,", "it does not begin with the device's GUID"),
        ("0" * 32 + ",,a:b0,", "it does not begin with the device's GUID"),
        ("0" * 32 + ",A stick,leftz:a0,", "'leftz' is neither an axis nor a button"),
        ("0" * 32 + ",A stick,leftx:axis0,", "leftx:axis0 is bound to no axis"),
        ("0" * 32 + ",A stick,leftx,", "leftx: is bound to no axis"),
        ("0" * 32 + ",A stick,leftx:a0,leftx:a1,", "leftx is bound twice"),
    ],
)
def test_a_file_that_sdl_would_ignore_is_an_error_with_its_row(tmp_path: Path, line: str, error: str) -> None:
    file = tmp_path / "mine.txt"
    file.write_text(f"# my sticks\n\n{line}\n")
    with pytest.raises(MappingError) as raised:
        Joysticks(tmp_path)
    assert str(raised.value).startswith(f"{file}, line 3: {error}")


def test_a_file_that_is_no_text_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(MappingError, match=r"mine\.txt cannot be read"):
        Joysticks(tmp_path)


def test_mappings_are_where_a_desktop_keeps_configurations(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    assert mapping_directory() == Path.home() / ".config/ual/joysticks"
    monkeypatch.setenv("XDG_CONFIG_HOME", "/elsewhere")
    assert mapping_directory() == Path("/elsewhere/ual/joysticks")


def test_without_a_home_directory_there_are_no_mappings_and_none_can_be_saved(monkeypatch: pytest.MonkeyPatch) -> None:
    """A container may run with any user id."""
    for name in ("HOME", "XDG_CONFIG_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("pwd.getpwuid", {}.__getitem__)
    with Joysticks():  # closed: what stays of SDL is a program's own window to the next one
        pass
    with pytest.raises(MappingError, match="set HOME or XDG_CONFIG_HOME"):
        mapping_directory()


def test_the_variables_of_the_program_stay_as_they_are(tmp_path: Path) -> None:
    before = dict(os.environ)
    with Joysticks(tmp_path):
        assert dict(os.environ) == before


def test_sigterm_still_ends_the_program() -> None:
    program = (
        "from ual.joystick import Joysticks\nimport time\n"
        "with Joysticks():\n    print(flush=True)\n    while True: time.sleep(1)\n"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE) as running:
        assert running.stdout is not None
        assert running.stdout.readline() == b"\n"
        running.terminate()
        assert running.wait(60.0) == -signal.SIGTERM


def test_without_pygame_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(NotSupportedError, match=r"pip install 'ual-client\[joystick\]'"):
        Joysticks(tmp_path)
