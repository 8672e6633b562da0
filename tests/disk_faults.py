"""The files that UAL writes, on a disk of their own that fails and comes back: `python -m tests.disk_faults FAULT`.

To be run in a mount namespace of its own (`unshare -rm`). Prints what went wrong with each file, as JSON.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from click.testing import CliRunner
from typing_extensions import override

from tests.waiting import until
from ual import discovery
from ual.access import audit
from ual.discovery import Registration
from ual.errors import UalError
from ual.joystick import Mapping
from ual.logs import Log, LogChunk
from ual.logs.files import PartialFile
from ual.parameters import Parameter, ParameterType, files
from ual.recording import recorder as recorder_module
from ual.recording.reader import Recording
from ual.recording.recorder import Entry, Output, Recorder, Turnover
from ual.recording.topics import JSON, Topic
from ual.shared import whole_file
from ual.shared.pauses import GrowingPauses
from ual.types import GeoPoint
from ual_daemon.backends.crazyflie.packets import LOG as LOG_PORT
from ual_daemon.backends.crazyflie.toc import TocCache, TocInfo, Variable
from ual_daemon.frames.home_file import HomeFile
from ual_daemon.program.recording import audit_writer
from ual_daemon.program.recording.audit_file import AuditFile
from ual_daemon.program.recording.audit_writer import AuditWriter
from ual_daemon.vehicle.mission_file import MissionFile, RunningMission
from ual_daemon.vehicle.upload_journal import JournalFile, UploadEntry
from ual_tools.launch.log_file import LogFile
from ual_tools.main import cli
from ual_tools.recording import tables, tracks

FULL, READ_ONLY, REMOVED, MOVED, NO_DESCRIPTOR = FAULTS = ("full", "read-only", "removed", "moved", "no descriptor")
_PAGES = "x" * 10000
"""More than what the last page of a file still takes on a full disk."""
_TOPIC = Topic("/uav_1/numbers", JSON)


class Disk:
    """A small disk, mounted on a directory; `directory` is a folder on it."""

    def __init__(self, mount: Path) -> None:
        self._mount = mount
        self.directory = mount / "files"
        self._mounted("-t", "tmpfs", "-o", "size=4m", "tmpfs")
        self.directory.mkdir()

    @contextmanager
    def failing(self, fault: str) -> Iterator[None]:
        """Fails during the block, and is back after it."""
        faults: dict[str, tuple[Callable[[], object], Callable[[], object]]] = {
            FULL: (self._fill, (self._mount / "filler").unlink),
            READ_ONLY: (partial(self._mounted, "-o", "remount,ro"), partial(self._mounted, "-o", "remount,rw")),
            REMOVED: (self._remove, self._make),
            MOVED: (partial(self.directory.rename, self._mount / "elsewhere"), self._make),
            NO_DESCRIPTOR: (_take_descriptors, _give_descriptors),
        }
        begin, end = faults[fault]
        begin()
        try:
            yield
        finally:
            end()

    def end(self) -> None:
        subprocess.run(["umount", "-l", self._mount], check=True)

    def _mounted(self, *arguments: str) -> None:
        subprocess.run(["mount", *arguments, self._mount], check=True)

    def _remove(self) -> None:
        """Removes the folder. A program that writes may make a file in it while it is emptied."""
        while self.directory.exists():
            shutil.rmtree(self.directory, ignore_errors=True)

    def _make(self) -> None:
        self.directory.mkdir(exist_ok=True)

    def _fill(self) -> None:
        with (self._mount / "filler").open("wb", buffering=0) as file:
            for size in (1 << 16, 1):
                try:
                    while file.write(b"x" * size):
                        pass
                except OSError:
                    continue


_descriptors = resource.getrlimit(resource.RLIMIT_NOFILE)


def _take_descriptors() -> None:
    lowest = os.dup(0)
    os.close(lowest)
    resource.setrlimit(resource.RLIMIT_NOFILE, (lowest, _descriptors[1]))


def _give_descriptors() -> None:
    resource.setrlimit(resource.RLIMIT_NOFILE, _descriptors)


class Written(ABC):
    """A file that is written on the disk."""

    @abstractmethod
    def begin(self) -> None:
        """While the disk is well."""

    @abstractmethod
    def during(self, fault: str) -> None:
        """While it fails. Raises `AssertionError` where this is not told."""

    @abstractmethod
    def after(self, fault: str) -> None:
        """Once it is back. Raises `AssertionError` where something is missing that need not be."""


class Whole(Written):
    """A file that is written whole: `make` writes it, and raises where it cannot."""

    def __init__(self, make: Callable[[Path, int], object], directory: Path) -> None:
        self._make, self.directory = make, directory
        self._before: dict[str, bytes] = {}

    @override
    def begin(self) -> None:
        self._make(self.directory, 0)
        self._before = _contents(self.directory)

    @override
    def during(self, fault: str) -> None:
        try:
            self._make(self.directory, 1)
        except (OSError, UalError):
            return
        assert fault in (REMOVED, MOVED), "wrote, as it says"  # it made the directory

    @override
    def after(self, fault: str) -> None:
        if fault in (FULL, READ_ONLY, NO_DESCRIPTOR):
            assert _contents(self.directory) == self._before, f"left {sorted(_contents(self.directory))}"
        self._make(self.directory, 2)


def _contents(directory: Path) -> dict[str, bytes]:
    return {str(path.relative_to(directory)): path.read_bytes() for path in directory.rglob("*") if path.is_file()}


class Kept(Written):
    """A file that the daemon keeps: `keep` keeps a number, `found` returns what the next daemon reads."""

    def __init__(
        self, keep: Callable[[int], object], again: Callable[[float], object], found: Callable[[], int]
    ) -> None:
        self._keep, self._again, self._found = keep, again, found

    @override
    def begin(self) -> None:
        self._keep(1)

    @override
    def during(self, fault: str) -> None:
        self._keep(2)
        self._again(0.0)

    @override
    def after(self, fault: str) -> None:
        self._again(100.0)
        assert self._found() == 2, f"the next daemon finds {self._found()}"


def _kept(directory: Path) -> dict[str, Written]:
    home, mission, journal = (directory / f"uav_1.{name}" for name in ("home", "mission", "uploads"))
    kept_home, kept_mission, kept_journal = HomeFile(home), MissionFile(mission), JournalFile(journal)

    def uploads(count: int) -> None:
        kept_journal.write(lambda: [UploadEntry("mission", "", count, 0.0)], is_durable=True)

    def found_mission() -> int:
        found = MissionFile(mission).read()
        return 0 if found is None else found.paused_at

    def found_home() -> int:
        found = HomeFile(home).read()
        return 0 if found is None or found.home is None else round(found.home.altitude_amsl_m or 0.0)

    return {
        "home": Kept(
            lambda number: kept_home.write("PX4", GeoPoint(47.0, 8.0, number), None, number),
            kept_home.kept.keep,
            found_home,
        ),
        "mission": Kept(
            lambda number: kept_mission.write(RunningMission("PX4", "ab", "1", number)),
            kept_mission.kept.keep,
            found_mission,
        ),
        "uploads": Kept(
            uploads, kept_journal.kept.keep, lambda: sum(each.items_count for each in JournalFile(journal).read())
        ),
    }


class Recorded(Written):
    """A recording, which goes on: each number that is put is found in one of its files."""

    def __init__(self, directory: Path, mount: Path) -> None:
        self._directory, self._mount = directory / "flights", mount
        self._count = 0

    @override
    def begin(self) -> None:
        self._recorder = Recorder(self._directory, "uav_1", Turnover(age_s=0.1))
        self._recorder.start()
        self._put()
        time.sleep(0.2)  # it is on the disk

    @override
    def during(self, fault: str) -> None:
        self._began = self._count
        for _ in range(20):
            self._put()
            time.sleep(0.02)  # entries come during the whole fault
        if fault == FULL:
            assert self._recorder.trouble, "does not say that it stands still"

    @override
    def after(self, fault: str) -> None:
        self._put()
        until(lambda: not self._recorder.trouble, "it has recovered")
        self._put()
        self._recorder.close()
        found = sorted(
            int(message.data.split()[0])
            for path in self._mount.rglob("*.mcap")
            for message in Recording(path).messages()
            if message.topic == _TOPIC.name
        )
        first = self._began if fault == REMOVED else 0
        assert found[-1:] == [self._count - 1], f"ends with {found[-1:]}"
        assert [each for each in found if each >= first] == list(range(first, self._count)), f"has {found}"

    def _put(self) -> None:
        self._recorder.put(_write_number, self._recorder.clock.now_ns(), self._count)
        self._count += 1


def _write_number(output: Output, entry: Entry) -> None:
    output.write(_TOPIC, f"{entry.value} {os.urandom(5000).hex()}".encode(), entry.log_ns, entry.log_ns)


class Audited(Written):
    """An audit, which goes on: each line is in it, and in its chain."""

    def __init__(self, directory: Path) -> None:
        self._file = directory / "audit.jsonl"

    @override
    def begin(self) -> None:
        self._writer = AuditWriter(AuditFile(self._file))
        self._writer.put(lambda: {"event": "ended", "number": 0})
        until(lambda: b'"number":0' in self._file.read_bytes(), "its first line is written")

    @override
    def during(self, fault: str) -> None:
        self._writer.put(lambda: {"event": "ended", "number": 1, "request": _PAGES})
        if fault == FULL:  # elsewhere its file is open, or another one makes the directory anew
            until(lambda: bool(self._writer.trouble), "it says that it cannot be written")

    @override
    def after(self, fault: str) -> None:
        until(self._has_second, "its line is written")
        self._writer.close()
        audit.verify(self._file.read_bytes().splitlines(keepends=True))

    def _has_second(self) -> bool:
        return not self._writer.trouble and self._file.exists() and b'"number":1,' in self._file.read_bytes()


class Appended(Written):
    """The log of a program of a team."""

    def __init__(self, directory: Path, mount: Path) -> None:
        self._path, self._mount = directory / "logs" / "uav_1.log", mount
        self._now_s = 0.0

    @override
    def begin(self) -> None:
        self._path.parent.mkdir()
        self._told: list[str] = []
        self._file = LogFile(self._path, self._told.append, lambda: self._now_s)
        assert self._file.write("before")

    @override
    def during(self, fault: str) -> None:
        self._now_s = 10.0
        is_written = self._file.write("during" + _PAGES)
        if fault == FULL:
            assert not is_written
            assert len(self._told) == 1

    @override
    def after(self, fault: str) -> None:
        self._now_s = 100.0
        assert self._file.write("after")
        self._file.close()
        lines = [line for path in self._mount.rglob("uav_1.log") for line in path.read_text().splitlines()]
        missing = ["1 lines are missing here: the file could not be written"]
        expected = ["before", *missing, "after"] if fault == FULL else ["before", "during" + _PAGES, "after"]
        assert sorted(lines) == sorted(expected[1:] if fault == REMOVED else expected), lines


class Fetched(Written):
    """A log of the autopilot that grows in its file."""

    _DATA = b"0123456789" * 2000

    def __init__(self, directory: Path) -> None:
        self._file = directory / "1.bin"
        self._log = Log("1", len(self._DATA), 5.0)

    @override
    def begin(self) -> None:
        with PartialFile(self._file, self._log) as part:
            part.add(LogChunk(self._log, 0, self._DATA[:7000]))

    @override
    def during(self, fault: str) -> None:
        try:
            self._fetch()
        except UalError:
            return
        assert fault in (REMOVED, MOVED), "wrote, as it says"  # another one has made the directory anew

    @override
    def after(self, fault: str) -> None:
        self._fetch()
        assert self._file.read_bytes() == self._DATA
        assert not list(self._file.parent.glob("1.bin.*")), "left its part"

    def _fetch(self) -> None:
        with PartialFile(self._file, self._log) as part:
            first = part.offset
            for offset in range(first, len(self._DATA), 1000):
                data = self._DATA[offset : offset + 1000]
                is_last = offset + 1000 >= len(self._DATA)
                sha256 = hashlib.sha256(self._DATA[first:]).hexdigest() if is_last else ""
                part.add(LogChunk(self._log, offset, data, sha256))
            part.finish()


def _command(words: Callable[[Path, int], list[str]], directory: Path, number: int) -> None:
    done = CliRunner().invoke(cli, words(directory, number))
    if done.exit_code:
        assert isinstance(done.exception, SystemExit), f"a traceback: {done.exception!r}"
        assert "already" not in done.stderr, f"says {done.stderr}"
        raise UalError(done.stderr)


def _registered(_directory: Path, number: int) -> None:
    Registration("uav_1", 1 + number, "127.0.0.1:1", "light", 0.0).write()


def _saved_toc(directory: Path, number: int) -> None:
    """Raises as the others do, where nothing was saved: a table that is not kept is read again from the firmware."""
    cache, info = TocCache(str(directory)), TocInfo(1, 7)
    toc = {f"a{number}.b": Variable(0, "f", False)}
    cache.save(LOG_PORT, info, toc)
    if cache.load(LOG_PORT, info) != toc:
        raise UalError("not kept")


WHOLE: dict[str, Callable[[Path, int], object]] = {
    "token": partial(
        _command,
        lambda folder, n: (
            f"token new --name a{n} --role pilot --output {folder}/{n}.token --file {folder}/tokens.json".split()
        ),
    ),
    "certificates": partial(
        _command, lambda folder, n: ["certificates", "authority", "--name", f"team{n}", "--dir", f"{folder}/{n}"]
    ),
    "parameters": lambda folder, n: files.write([Parameter("A", 1.0 + n, ParameterType.REAL32)], folder / "a.param"),
    "joystick": lambda folder, n: Mapping(f"{7:032x}", f"pad {n}", {"a": "b0"}).save(folder),
    "csv": lambda folder, n: tables.write_csv(folder / "a.csv", [[n] * len(tables.HEADER)] * 100),
    "kml": lambda folder, n: tracks.write_kml(folder / "a.kml", {"uav_1": [tracks.Point(47.0, 8.0, 400.0, n)]}, f"{n}"),
    "gateway, cameras, launch": lambda folder, n: whole_file.write(
        folder / "uavs.map", f"{n}", whole_file.READABLE_PERMISSIONS
    ),
    "registration": _registered,
    "toc": _saved_toc,
}


def run(fault: str, mount: Path) -> dict[str, str]:
    """Returns what went wrong with which file."""
    disk = Disk(mount)
    os.environ[discovery.RUNTIME_DIR_VARIABLE] = str(disk.directory / "registration")
    written: dict[str, Written] = {}
    for name, make in WHOLE.items():
        (disk.directory / name).mkdir()
        written[name] = Whole(make, disk.directory / name)
    written |= _kept(disk.directory)
    written["fetched log"] = Fetched(disk.directory)
    if fault != READ_ONLY:  # a disk with files that are open cannot be made so
        recorded = Recorded(disk.directory, mount), Audited(disk.directory), Appended(disk.directory, mount)
        written |= dict(zip(("recording", "audit", "log of a program"), recorded, strict=True))
    wrong: dict[str, str] = {}
    _each(written, wrong, lambda one: one.begin())
    with disk.failing(fault):
        _each(written, wrong, lambda one: one.during(fault))
    if fault in (REMOVED, MOVED):
        for name in WHOLE:
            (disk.directory / name).mkdir(exist_ok=True)
    _each(written, wrong, lambda one: one.after(fault))
    disk.end()
    return wrong


def _each(written: dict[str, Written], wrong: dict[str, str], work: Callable[[Written], None]) -> None:
    for name, one in written.items():
        try:
            work(one)
        except Exception as error:  # noqa: BLE001  it is told
            wrong.setdefault(name, f"{type(error).__name__}: {error}")


if __name__ == "__main__":
    logging.getLogger().addHandler(logging.NullHandler())
    recorder_module.FLUSH_S = 0.05
    vars(recorder_module)["GrowingPauses"] = partial(GrowingPauses, 0.02, 0.1)
    vars(audit_writer)["_RETRY_S"] = vars(audit_writer)["_FILE_CHECK_S"] = 0.02
    with tempfile.TemporaryDirectory() as folder:
        print(json.dumps(run(sys.argv[1], Path(folder))))
