"""The client and its command where the system lacks what only POSIX has, as Windows does."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.conftest import LIMIT_S, DaemonProcess
from ual_tools import console_keys, terminal
from ual_tools.keys import Key

# Python's own modules come first: they have asked already what the system has.
WITHOUT_POSIX = """
import asyncio, logging, multiprocessing, os, random, select, selectors, shutil, signal, socket, subprocess, sys
import tempfile
for name in ("fcntl", "termios", "tty", "pty", "pwd", "grp", "resource", "curses"):
    sys.modules[name] = None
for owner, names in (
    (signal, "SIGHUP SIGTSTP SIGQUIT SIGKILL SIGUSR1 SIGALRM SIGCHLD SIGWINCH SIGCONT SIGPIPE pthread_kill"),
    (os, "O_NOFOLLOW O_NONBLOCK O_CLOEXEC fchmod fork register_at_fork killpg getuid geteuid getsid setsid fdatasync"),
):
    for name in names.split():
        delattr(owner, name)

def of_sockets(*files, asked=select.select):
    if not any(files[:3]):
        raise OSError(10022, "An invalid argument was supplied")
    return asked(*files)

select.select = of_sockets
"""
COMMAND = WITHOUT_POSIX + "from ual_tools.main import main; main()"
PROGRAM = (
    WITHOUT_POSIX + "import ual\nwith ual.Uav('uav_1') as uav: uav.take_off(2.0); uav.land(); print(uav.state().name)"
)


def run(program: str, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", program, *words]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=LIMIT_S, check=False, stdin=subprocess.DEVNULL
    )


@pytest.mark.parametrize(
    "words",
    [
        ("list",),
        ("state",),
        ("--ns", "uav_1", "state"),
        ("--all", "state"),
        ("frames",),
        ("watch", "--once"),
        ("info",),
    ],
)
def test_a_command_works(daemon: DaemonProcess, words: tuple[str, ...]) -> None:
    daemon.wait_for("state", new="LANDED_ARMED")
    done = run(COMMAND, *words)
    # On a busy computer the simulation is behind, and the commands say so.
    errors = [line for line in done.stderr.splitlines() if not re.search(r"simulated time is \S+ s behind$", line)]
    assert (done.returncode, errors) == (0, [])
    assert done.stdout


def test_a_flight_is_recorded(daemon: DaemonProcess, tmp_path: Path) -> None:
    daemon.wait_for("state", new="LANDED_ARMED")
    done = run(COMMAND, "record", "--duration", "0.1", "--directory", str(tmp_path))
    assert (done.returncode, done.stderr.count("\n")) == (0, 1), done.stderr


def test_a_program_flies(daemon: DaemonProcess) -> None:
    daemon.wait_for("state", new="LANDED_ARMED")
    done = run(PROGRAM)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("LANDED")


@pytest.mark.parametrize(
    ("words", "said"), [(("teleop", "keyboard"), "terminal"), (("launch", "x.yaml"), "Linux and macOS")]
)
def test_what_cannot_work_says_so(daemon: DaemonProcess, words: tuple[str, ...], said: str) -> None:
    del daemon
    done = run(COMMAND, *words)
    assert done.returncode in (1, 2)
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_the_keys_of_a_console_are_those_of_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    waiting = ["\xe0", "H", "q", "\x00", "Q", "\xe0", "?"]
    console = SimpleNamespace(kbhit=lambda: bool(waiting), getwch=lambda: waiting.pop(0))
    monkeypatch.setattr(console_keys, "importlib", SimpleNamespace(import_module=lambda _: console))
    keyboard = console_keys.ConsoleKeyboard(0)
    assert keyboard.wait(0.0) == [Key.UP, Key.QUIT, Key.PAGE_DOWN]
    assert keyboard.wait(0.0) == []
    assert not keyboard.is_gone


def test_a_console_is_read_where_there_are_no_terminals(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "termios", None)
    monkeypatch.setitem(sys.modules, "msvcrt", SimpleNamespace(kbhit=lambda: False))
    monkeypatch.setattr(terminal, "sys", SimpleNamespace(stdin=SimpleNamespace(isatty=lambda: True, fileno=lambda: 0)))
    with terminal.keyboard() as found:
        assert type(found).__name__ == "ConsoleKeyboard"
        assert found.read(0.0) == b""


def test_without_a_terminal_no_key_is_pressed() -> None:
    done = run(WITHOUT_POSIX + "from ual_tools.keys import TerminalKeys\nprint(TerminalKeys(None).wait(0.01))")
    assert (done.stdout, done.stderr) == ("[]\n", "")


def test_the_harness_takes_away_what_it_says() -> None:
    assert hasattr(os, "fork")
    done = run(WITHOUT_POSIX + "\nimport fcntl")
    assert "import of fcntl halted" in done.stderr
