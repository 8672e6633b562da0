"""Counts of instructions: of parts of a program that runs under valgrind's callgrind, by its client requests."""

from __future__ import annotations

import ctypes
import gc
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from typing_extensions import Self

from benchmarks.children import REPOSITORY

_REQUESTS = Path(__file__).with_name("requests.c")
_LIBRARY = "GUARD_REQUESTS"
_TRIGGER = re.compile(r"^desc: Trigger: Client Request: (.+):(\d+)$", re.MULTILINE)
_TOTALS = re.compile(r"^totals: (\d+)", re.MULTILINE)
_LIMIT_S = 600.0
_UNREAD, _NOTHING = "-", "nothing"
_NOTHING_COUNT = 5
"""Counts of an empty function: a count executes some 9,000 instructions of its own, which belong to no figure."""
_KEPT = ("PATH", "OPENBLAS_CORETYPE", "OPENBLAS_L2_SIZE", "GUARD_DEFECT")
"""Variables of the environment that a counted program gets. Any other one would move its stack and its dictionaries."""


class CountError(Exception):
    """A counted program failed; the message says what it printed."""


class MissingToolError(Exception):
    """A tool is not installed; the message names it and how to install it."""


def counted(module: str, *arguments: str) -> dict[str, float]:
    """Runs a module, and returns the instructions of its counts (`Counter`): the median of those of one name."""
    with begun(module, *arguments) as process:
        return process.ended()


@contextmanager
def begun(module: str, *arguments: str, from_start: bool = False) -> Iterator[CountedProcess]:
    """Runs a module. With `from_start` it is counted from its first instruction on, with all of its threads."""
    for tool in ("valgrind", "setarch", "cc"):
        if shutil.which(tool) is None:
            raise MissingToolError(f"{tool} is not there (Debian: apt-get install valgrind util-linux gcc libc6-dev)")
    with (
        tempfile.TemporaryDirectory(prefix="ual-guard-") as name,
        CountedProcess(Path(name), module, arguments, from_start=from_start) as process,
    ):
        yield process


class CountedProcess:
    """A module that runs under callgrind, with a directory of its own."""

    def __init__(self, directory: Path, module: str, arguments: Sequence[str], *, from_start: bool) -> None:
        self._directory, self._module = directory, module
        self._has_all_threads = from_start
        library = directory / "requests.so"
        subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", library, _REQUESTS], check=True)
        yes_or_no = {True: "yes", False: "no"}
        self._log = (directory / "log").open("w+")
        run, environment = [sys.executable, "-m", module, *arguments], _environment(directory, library)
        # Once before, so that its modules are compiled: under callgrind that would take minutes.
        self._run = partial(subprocess.Popen, cwd=REPOSITORY, stdout=self._log, stderr=subprocess.STDOUT)
        self._process = self._run(run, env=environment)
        self._require_success()
        callgrind = [
            *("setarch", "-R", "valgrind", "--tool=callgrind", "--quiet"),
            *(f"--instr-atstart={yes_or_no[from_start]}", f"--separate-threads={yes_or_no[not from_start]}"),
            f"--callgrind-out-file={directory}/counts",
        ]
        self._process = self._run([*callgrind, *run], env={**environment, "PYTHONDONTWRITEBYTECODE": "1"})

    def ended(self) -> dict[str, float]:
        """Waits for its end, and returns the instructions of each name."""
        self._require_success()
        found = totals(self._directory, has_all_threads=self._has_all_threads)
        return {what: statistics.median(each) for what, each in found.items()}

    def _require_success(self) -> None:
        status = self._process.wait(_LIMIT_S)
        if status:
            self._log.seek(0)
            raise CountError(f"{self._module} ended with status {status}:\n{self._log.read()}")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()
        self._log.close()


def totals(directory: Path, *, has_all_threads: bool) -> Mapping[str, Sequence[float]]:
    """Reads what all threads counted, or the first one only: `Counter.count` runs on that."""
    counts: list[tuple[str, int, int]] = []
    for path in sorted(directory.glob("counts.*" if has_all_threads else "counts.*-01")):
        text = path.read_text()
        trigger, total = _TRIGGER.search(text), _TOTALS.search(text)
        if trigger and total and trigger[1] != _UNREAD:
            counts.append((trigger[1], int(trigger[2]), int(total[1])))
    own = [count for name, _, count in counts if name == _NOTHING]
    own_count = statistics.median(own) if own else 0.0
    found: dict[str, list[float]] = defaultdict(list)
    for name, times, count in counts:
        if name != _NOTHING:
            found[name].append((count - own_count) / times)
    return found


def _environment(directory: Path, library: Path) -> Mapping[str, str]:
    """Returns an environment in which each run executes the same instructions."""
    kept = {name: os.environ[name] for name in _KEPT if name in os.environ}
    own = {"HOME": str(directory), "UAL_RUNTIME_DIR": str(directory), _LIBRARY: str(library)}
    return {**kept, **own, "PYTHONHASHSEED": "0"}


class Counter:
    """The counts of a program that runs under callgrind. Started any other way it counts nothing, and only acts."""

    def __init__(self) -> None:
        path = os.environ.get(_LIBRARY)
        self._requests = None if path is None else ctypes.CDLL(path)

    def begin(self) -> None:
        """Begins to count: to be called once, after everything was warmed up."""
        gc.collect()
        gc.freeze()
        gc.disable()
        if self._requests is not None:
            self._requests.begin()
        for _ in range(_NOTHING_COUNT):
            self.count(_NOTHING, lambda _: None)

    def count(self, what: str, act: Callable[[int], object], times: int = 1) -> None:
        """Counts the instructions of one of so many calls. `act` gets the number of the call."""
        self.dump(_UNREAD)
        for number in range(times):
            act(number)
        self.dump(what, times)

    def dump(self, what: str, times: int = 1) -> None:
        """Ends a count of so many calls, and begins the next one."""
        if self._requests is not None:
            self._requests.dump(f"{what}:{times}".encode())
