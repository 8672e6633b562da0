"""`ual teleop keyboard` on a pseudo-terminal, with a daemon: keys fly, and every way to leave stops the UAV."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator

import pytest
from click.testing import CliRunner

import ual
from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon
from tests.ual_tools.terminal import Terminal
from tests.waiting import until
from ual.geometry import Vector3
from ual.types import State, Telemetry
from ual_tools.main import cli

UP_ARROW = b"\x1b[A"
SPEED_M_S = 0.5
"""Of the speed level that teleop begins with."""
ACCELERATION_M_S2 = 0.8
"""The least that the light UAV brakes with."""


@pytest.fixture(autouse=True)
def nothing_from_outside(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("UAL_NS", "UAL_ADDRESS", "UAL_TLS_CA"):
        monkeypatch.delenv(name, raising=False)
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def uav(daemon: DaemonProcess) -> Iterator[ual.Uav]:
    """A UAV that stands armed on the ground, ten times as fast as real."""
    with ual.Uav(daemon.ns) as uav:
        uav.wait_for(State.LANDED_ARMED, timeout_s=LIMIT_S)
        yield uav


@pytest.fixture
def flying(uav: ual.Uav) -> ual.Uav:
    """A UAV that flies, as fast as real."""
    uav.take_off(2.0)
    uav.simulation.set_speed_factor(1.0)
    return uav


def speed(uav: ual.Uav) -> float:
    return uav.velocity().twist.linear.norm()


class Held:
    """A key that is held: the terminal repeats it 30 times a second."""

    def __init__(self, terminal: Terminal, key: bytes) -> None:
        self._terminal = terminal
        self._key = key
        self._is_released = threading.Event()
        self._thread = threading.Thread(target=self._repeat)

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *exc: object) -> None:
        self._is_released.set()
        self._thread.join()

    def _repeat(self) -> None:
        while not self._is_released.wait(1.0 / 30.0):
            self._terminal.press(self._key)


def fly_forward(terminal: Terminal, uav: ual.Uav) -> None:
    """Holds the key until the UAV flies with full speed."""
    terminal.wait_until(lambda: "FLYING_AUTO" in terminal.text)  # drawn once, it stays
    with Held(terminal, UP_ARROW):
        terminal.wait_until(lambda: speed(uav) > 0.8 * SPEED_M_S)


# --- Flying -----------------------------------------------------------------------------------------------------------


def test_a_flight_by_keys(uav: ual.Uav) -> None:
    with Terminal("teleop", "keyboard", size=(80, 24)) as terminal:
        before = terminal.mode()
        terminal.wait_for("LANDED_ARMED")
        terminal.press(b"t")
        terminal.wait_for("Enter confirms")
        terminal.press(b"\r")
        terminal.wait_for("take-off: done")
        assert uav.pose().pose.position.z == pytest.approx(2.0, abs=0.3)
        uav.simulation.set_speed_factor(1.0)
        with Held(terminal, UP_ARROW):
            terminal.wait_until(lambda: uav.pose().pose.position.x > 0.5)
        terminal.wait_until(lambda: speed(uav) < 0.05)
        with Held(terminal, b"w"):
            terminal.wait_until(lambda: uav.pose().pose.position.z > 2.4)
        uav.simulation.set_speed_factor(10.0)
        terminal.press(b"l")
        terminal.wait_for("land: done")
        terminal.press(b"q")
        assert terminal.wait() == 0
        assert terminal.mode() == before


def test_nothing_is_sent_until_a_key_is_pressed(flying: ual.Uav, daemon: DaemonProcess) -> None:
    task = flying.go_to_waypoint(ual.Pose.at(300.0, 0.0, 2.0), blocking=False)
    begun = daemon.wait_for("command", command="go_to_waypoint")
    with Terminal("teleop", "keyboard") as terminal:
        terminal.wait_for("FLYING_AUTO")
        terminal.press(b"+-h\t")  # none of these flies
        terminal.press_until(b"t", "Enter confirms")
        terminal.press(b"q")
        assert terminal.wait() == 0
    assert not task.done()
    assert not [
        event
        for event in daemon.events[daemon.events.index(begun) + 1 :]
        if event["event"] in ("command", "task_ended")
    ]


def test_space_stops_at_once(flying: ual.Uav, daemon: DaemonProcess) -> None:
    with Terminal("teleop", "keyboard") as terminal:
        fly_forward(terminal, flying)
        terminal.press(b" ")
        daemon.wait_for("command", command="abort")
        terminal.wait_until(lambda: speed(flying) < 0.05)


def test_a_key_moves_the_reference_by_a_step(flying: ual.Uav) -> None:
    begin = flying.pose().pose.position
    with Terminal("teleop", "keyboard", is_patient=True) as terminal:
        terminal.wait_for("FLYING_AUTO")
        terminal.press(b"p")
        terminal.wait_for("steps of 0.25 m")
        for keys, step in ((UP_ARROW, (0.25, 0.0, 0.0)), (b"hs", (0.25, 0.0, -0.25)), (UP_ARROW, (0.25, 0.25, -0.25))):
            goal = begin + Vector3(*step)

            def is_there(goal: Vector3 = goal) -> bool:
                return (flying.pose().pose.position - goal).norm() < 0.1 and speed(flying) < 0.05

            terminal.press(keys)
            terminal.wait_until(is_there)


def test_a_refusal_is_shown(uav: ual.Uav) -> None:
    del uav
    with Terminal("teleop", "keyboard") as terminal:
        terminal.wait_for("LANDED_ARMED")
        terminal.press(UP_ARROW)
        terminal.wait_for("sticks: WRONG_STATE")


def test_a_change_of_the_uav_stops_the_one_that_is_left(start_daemon: StartDaemon) -> None:
    fleet = start_daemon("--fleet", "2", "--auto-arm", "--set", "light.speed_factor=10")
    fleet.wait_for("listening")
    with ual.Uav("uav_1") as first, ual.Uav("uav_2") as second:
        for each in (first, second):
            each.wait_for(State.LANDED_ARMED, timeout_s=LIMIT_S)
            each.take_off(2.0)
            each.simulation.set_speed_factor(1.0)
        with Terminal("--ns", "uav_1,uav_2", "teleop", "keyboard") as terminal:
            terminal.wait_for("uav_1 (1 of 2")
            fly_forward(terminal, first)
            terminal.press(b"\t")
            terminal.wait_for("uav_2 (2 of 2")
            terminal.wait_until(lambda: speed(first) < 0.05)
            fly_forward(terminal, second)
            assert speed(first) < 0.05


# --- Leaving ----------------------------------------------------------------------------------------------------------


def ctrl_c(terminal: Terminal) -> None:
    terminal.interrupt()
    assert terminal.wait() == 130


def terminated(terminal: Terminal) -> None:
    terminal.process.send_signal(signal.SIGTERM)
    assert terminal.wait() == 128 + signal.SIGTERM


def quit_by_key(terminal: Terminal) -> None:
    terminal.press(b"q")
    assert terminal.wait() == 0


@pytest.mark.parametrize("leave", [ctrl_c, terminated, quit_by_key])
def test_leaving_stops_the_uav_and_restores_the_terminal(
    leave: Callable[[Terminal], None], flying: ual.Uav, daemon: DaemonProcess
) -> None:
    with Terminal("teleop", "keyboard") as terminal:
        before = terminal.mode()
        fly_forward(terminal, flying)
        leave(terminal)
        daemon.wait_for("command", command="abort")
        assert "\x1b[?25h\x1b[?1049l" in terminal.text
        assert "uav_1 stops and holds its position" in terminal.text.rpartition("\x1b[?1049l")[2]
        assert terminal.mode() == before
        terminal.wait_until(lambda: speed(flying) < 0.05)


def test_a_terminal_that_is_lost_stops_the_uav(flying: ual.Uav, daemon: DaemonProcess) -> None:
    with Terminal("teleop", "keyboard", is_controlling=True) as terminal:
        fly_forward(terminal, flying)
        terminal.close()
        daemon.wait_for("command", command="abort")
        assert terminal.process.wait(LIMIT_S) == 128 + signal.SIGHUP


def test_ctrl_z_stops_the_uav_and_nothing_flies_when_it_is_resumed(flying: ual.Uav, daemon: DaemonProcess) -> None:
    with Terminal("teleop", "keyboard") as terminal:
        before = terminal.mode()
        fly_forward(terminal, flying)
        terminal.process.send_signal(signal.SIGTSTP)
        stopped = os.waitid(os.P_PID, terminal.process.pid, os.WSTOPPED | os.WEXITED | os.WNOWAIT)
        assert stopped is not None
        assert stopped.si_code == os.CLD_STOPPED
        daemon.wait_for("command", command="abort")
        assert terminal.mode() == before
        terminal.wait_until(lambda: speed(flying) < 0.05)
        at = flying.pose().pose.position
        terminal.forget()
        terminal.process.send_signal(signal.SIGCONT)
        terminal.wait_for("forward +0.00")
        assert terminal.mode() != before
        assert (flying.pose().pose.position - at).norm() < 0.1
        fly_forward(terminal, flying)


def test_a_frozen_process_does_not_repeat_old_keys(flying: ual.Uav, daemon: DaemonProcess) -> None:
    with Terminal("teleop", "keyboard") as terminal:
        fly_forward(terminal, flying)
        terminal.process.send_signal(signal.SIGSTOP)
        terminal.press(UP_ARROW * 20)
        daemon.wait_for("velocity_ended")
        terminal.wait_until(lambda: speed(flying) < 0.05)
        at = flying.pose().pose.position
        terminal.forget()
        terminal.process.send_signal(signal.SIGCONT)
        terminal.wait_for("forward")
        terminal.press(b"q")
        assert terminal.wait() == 0
        assert (flying.pose().pose.position - at).norm() < 0.1


def test_killed_in_flight_it_stands_within_half_a_second_plus_braking(flying: ual.Uav) -> None:
    samples: list[Telemetry] = []
    with Terminal("teleop", "keyboard") as terminal, flying.subscribe(samples.append):
        terminal.wait_for("FLYING_AUTO")
        with Held(terminal, UP_ARROW):
            terminal.wait_until(lambda: speed(flying) > 0.8 * SPEED_M_S)
            terminal.process.kill()
            terminal.process.wait()
        killed_s = flying.telemetry().stamp_s
        terminal.wait_until(lambda: samples[-1].stamp_s > killed_s + 2.0)
    flown = [sample.stamp_s - killed_s for sample in samples if sample.velocity.linear.norm() > 0.05]  # type: ignore[union-attr]
    assert max(flown) < 0.5 + SPEED_M_S / ACCELERATION_M_S2 + 0.2


def test_a_terminal_that_takes_no_output_stops_the_uav(flying: ual.Uav) -> None:
    with Terminal("teleop", "keyboard") as terminal:
        fly_forward(terminal, flying)
        with Held(terminal, UP_ARROW):
            until(lambda: speed(flying) <= 0.05, seen=flying.telemetry)  # nobody reads
            terminal.wait_for("the terminal is slow")


def test_a_terminal_that_answers_late_stops_the_uav(flying: ual.Uav) -> None:
    with Terminal("teleop", "keyboard", is_answering=True) as terminal:
        terminal.wait_until(lambda: terminal.answers_count >= 1)
        fly_forward(terminal, flying)
        terminal.is_answering = False
        with Held(terminal, UP_ARROW):
            terminal.wait_for("the terminal is slow")
            terminal.wait_until(lambda: speed(flying) < 0.05)
        terminal.is_answering = True
        terminal.answer()
        fly_forward(terminal, flying)


def test_without_telemetry_the_sticks_do_nothing(flying: ual.Uav, daemon: DaemonProcess) -> None:
    with Terminal("teleop", "keyboard") as terminal:
        fly_forward(terminal, flying)
        with daemon.frozen():
            terminal.wait_for("NONE FOR")
            terminal.press(UP_ARROW)
            terminal.wait_for("sticks: no telemetry")


def test_it_needs_a_terminal() -> None:
    result = CliRunner().invoke(cli, ["teleop", "keyboard"])
    assert result.exit_code == 2
    assert "needs a terminal" in result.stderr
