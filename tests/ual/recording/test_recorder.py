"""The recorder: nothing waits for it, and what it has written can be read, however it ends."""

from __future__ import annotations

import errno
import json
import logging
import os
import subprocess
import sys
import threading
import time
from functools import partial
from pathlib import Path

import pytest

from tests.waiting import LIMIT_S, until
from ual.errors import NotSupportedError
from ual.recording import recorder as recorder_module
from ual.recording import requirements
from ual.recording.file import File
from ual.recording.reader import Recording
from ual.recording.recorder import METADATA, Entry, Output, Recorder, Turnover
from ual.recording.topics import JSON, Topic
from ual.shared.pauses import GrowingPauses

TOPIC = Topic("/uav_1/numbers", JSON)


def write_number(output: Output, entry: Entry) -> None:
    output.write(TOPIC, str(entry.value).encode(), entry.log_ns, entry.log_ns)


def numbers(path: Path) -> list[int]:
    return [int(message.data) for message in Recording(path).messages()]


def put(recorder: Recorder, number: int) -> None:
    recorder.put(write_number, recorder.clock.now_ns(), number)


def test_what_is_recorded_is_in_the_file_in_its_order(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "new" / "folder", "uav_1")
    recorder.start()
    for number in range(1000):
        put(recorder, number)
    recorder.close()
    put(recorder, 1000)  # too late
    recording = Recording(recorder.path)
    assert [int(message.data) for message in recording.messages()] == list(range(1000))
    assert recording.is_whole
    assert recording.metadata[METADATA]["name"] == "uav_1"
    assert recorder.lost_count == 0


def test_files_turn_over_by_size_and_by_age(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorder_module, "FLUSH_S", 0.0)
    for name, turnover in (("size", Turnover(size_bytes=1)), ("age", Turnover(age_s=0.0))):
        recorder = Recorder(tmp_path, name, turnover)
        began = threading.Semaphore(0)
        recorder.at_each_file(began.release)
        recorder.start()
        for number in range(4):
            put(recorder, number)
            assert began.acquire(timeout=LIMIT_S)
        recorder.close()
        files = sorted(tmp_path.glob(f"{name}_*"), key=lambda path: path.stat().st_mtime_ns)
        assert len(files) >= 4
        assert sorted(number for file in files for number in numbers(file)) == [0, 1, 2, 3]
        assert all(list(Recording(file).messages()) is not None for file in files)


def test_after_the_clock_was_set_it_goes_on_in_a_file_of_that_date(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A field computer begins in 1970, until it has heard the time."""
    monkeypatch.setattr(recorder_module, "FLUSH_S", 0.0)
    monkeypatch.setattr(recorder_module, "_offset_ns", lambda: -time.monotonic_ns())
    recorder = Recorder(tmp_path, "uav_1")
    began = threading.Event()
    recorder.at_each_file(began.set)
    assert "_1970" in recorder.path.name
    recorder.start()
    put(recorder, 1)
    now_ns = time.time_ns()
    monkeypatch.setattr(recorder_module, "_offset_ns", lambda: now_ns)
    assert began.wait(LIMIT_S)
    put(recorder, 2)
    recorder.close()
    before, after = sorted(tmp_path.iterdir())
    assert "_1970" in before.name
    assert f"_{time.gmtime(now_ns / 1e9).tm_year}" in after.name
    told = {name: list(Recording(name).messages()) for name in (before, after)}
    assert [json.loads(each.data)["what"] for each in told[after] if each.topic == "/untold"] == ["the file before"]


def test_only_its_user_reads_a_recording(tmp_path: Path) -> None:
    """As with the audit: it contains positions of UAVs."""
    recorder = Recorder(tmp_path, "uav_1")
    assert recorder.path.stat().st_mode & 0o777 == 0o600
    recorder.close()


class FailingDisk(File):
    """A file on a disk that fails for a while."""

    fault = 0

    def flush(self) -> None:
        if self.fault and self.size_bytes:  # not while it is made
            raise OSError(self.fault, os.strerror(self.fault))
        super().flush()


@pytest.mark.parametrize("fault", [errno.ENOSPC, errno.EROFS, errno.EIO])
def test_a_disk_that_fails_for_a_while_costs_nothing_that_still_waits(
    fault: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(recorder_module, "FLUSH_S", 0.0)
    monkeypatch.setattr(recorder_module, "GrowingPauses", partial(GrowingPauses, 0.0, 0.0))
    FailingDisk.fault = 0
    recorder = Recorder(tmp_path, "uav_1", make_file=FailingDisk)
    first = recorder.path
    recorder.start()
    put(recorder, 0)
    until(lambda: numbers(first) == [0])
    FailingDisk.fault = fault
    put(recorder, 1)
    until(lambda: recorder.trouble == os.strerror(fault))
    assert not recorder.figures.is_running
    put(recorder, 2)
    FailingDisk.fault = 0
    until(lambda: not recorder.trouble)
    put(recorder, 3)
    recorder.close()
    assert (numbers(first), numbers(recorder.path)) == ([0], [1, 2, 3])
    lines = [record.getMessage() for record in caplog.records if record.levelno >= logging.ERROR]
    assert [line.partition(":")[0] for line in lines] == [
        "THE RECORDING STANDS STILL",
        "the recording has recovered",
    ]
    assert "nothing is missing" in lines[-1]


def test_what_did_not_wait_is_missing_and_the_next_file_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(recorder_module, "FLUSH_S", 0.0)
    monkeypatch.setattr(recorder_module, "MOST_ENTRIES", 5)
    monkeypatch.setattr(recorder_module, "GrowingPauses", partial(GrowingPauses, 0.0, 0.0))
    FailingDisk.fault = errno.ENOSPC
    recorder = Recorder(tmp_path, "uav_1", make_file=FailingDisk)
    recorder.start()
    put(recorder, 0)
    until(lambda: bool(recorder.trouble))
    for number in range(1, 21):
        put(recorder, number)
    FailingDisk.fault = 0
    until(lambda: not recorder.trouble)
    recorder.close()
    found = list(Recording(recorder.path).messages())
    assert [int(each.data) for each in found if each.topic == TOPIC.name] == [0, 1, 2, 3, 4, 5]
    assert [json.loads(each.data)["what"] for each in found if each.topic == "/untold"] == ["15 entries"]
    assert "15 records are missing" in caplog.text


def test_a_disk_that_fails_until_the_end_is_reported_once_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(recorder_module, "FLUSH_S", 0.0)
    FailingDisk.fault = errno.ENOSPC
    recorder = Recorder(tmp_path, "uav_1", make_file=FailingDisk)
    recorder.start()
    put(recorder, 0)
    until(lambda: bool(recorder.trouble))
    put(recorder, 1)
    recorder.close()
    assert "THE RECORDING IS NOT COMPLETE: 2 records could not be written" in caplog.text
    assert not list(tmp_path.iterdir())  # nothing that looks like a recording


def test_files_go_on_past_a_limit_of_the_system_for_one(tmp_path: Path) -> None:
    program = f"""
import logging, resource, signal, sys, time
from pathlib import Path
sys.path.insert(0, {str(Path.cwd())!r})
from tests.ual.recording.test_recorder import put
from ual.recording.recorder import Recorder
logging.basicConfig(level=logging.INFO, format="%(message)s")
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
recorder = Recorder(Path({str(tmp_path)!r}), "uav_1")
recorder.start()
number = 0
while not recorder.trouble:
    for _ in range(1000):
        put(recorder, number * 7919 ** 20)
        number += 1
    time.sleep(0.01)
print("the flight goes on")
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=LIMIT_S)
    assert done.stdout == "the flight goes on\n", done.stderr
    assert [line.partition(":")[0] for line in done.stderr.splitlines()] == ["THE RECORDING STANDS STILL"]


def test_a_disk_that_writes_nothing_delays_nobody_and_the_losses_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(recorder_module, "FLUSH_S", 0.0)
    monkeypatch.setattr(recorder_module, "MOST_ENTRIES", 10)
    may_write = threading.Event()
    is_writing = threading.Event()

    def wait(*_: object) -> None:
        is_writing.set()
        assert may_write.wait(LIMIT_S)

    recorder = Recorder(tmp_path, "uav_1")
    recorder.start()
    recorder.put(wait, 0, None)
    assert is_writing.wait(LIMIT_S)
    for number in range(25):
        put(recorder, number)
    assert recorder.lost_count == 15
    may_write.set()
    recorder.close()
    assert numbers(recorder.path) == list(range(10))
    assert [r.getMessage() for r in caplog.records] == [
        f"15 records lost, 15 in all: the disk of {tmp_path} is too slow for the recording"
    ]


def test_large_entries_are_bounded_by_their_bytes(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, "uav_1")  # not started: nothing is taken
    for number in range(200):
        recorder.put(write_number, 0, number, size_bytes=1 << 20)
    assert recorder.lost_count == 136
    recorder.close()


def test_what_cannot_be_encoded_is_reported_in_its_position_and_the_rest_is_recorded(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(*_: object) -> None:
        raise ValueError("a defect")

    recorder = Recorder(tmp_path, "uav_1")
    recorder.start()
    for number in range(5):
        recorder.put(fail, 0, None)
        put(recorder, number)
    recorder.close()
    found = list(Recording(recorder.path).messages())
    assert [int(each.data) for each in found if each.topic != "/untold"] == [0, 1, 2, 3, 4]
    assert [json.loads(each.data)["why"] for each in found if each.topic == "/untold"] == ["ValueError: a defect"] * 5
    assert len(caplog.records) == 1


def test_what_repeats_itself_in_each_file_may_fail(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    def fail() -> None:
        raise OverflowError("a defect")

    recorder = Recorder(tmp_path, "uav_1", Turnover(size_bytes=1))
    begun = threading.Event()
    recorder.at_each_file(fail)
    recorder.at_each_file(begun.set)
    recorder.start()
    put(recorder, 1)
    assert begun.wait(LIMIT_S)
    assert not recorder.has_ended
    recorder.close()
    assert [each.name for each in caplog.records] == ["ual.shared.guard"]


@pytest.mark.parametrize("cut_bytes", [1, 7, 100])
def test_a_file_that_ends_in_the_middle_is_read_up_to_there(tmp_path: Path, cut_bytes: int) -> None:
    file = File(tmp_path / "cut.mcap", {})
    for number in range(3):
        file.write(TOPIC, str(number).encode(), number, number)
        file.flush()
    size_bytes = file.size_bytes
    file.write(TOPIC, b"3", 3, 3)
    file.flush()
    file.give_up()
    with file.path.open("r+b") as raw:
        raw.truncate(size_bytes - cut_bytes if cut_bytes > 50 else size_bytes + cut_bytes)
    recording = Recording(file.path)
    found = [int(message.data) for message in recording.messages()]
    assert found == ([0, 1, 2] if cut_bytes <= 50 else [0, 1])
    assert not recording.is_whole


def test_a_damaged_file_is_read_up_to_the_damage(tmp_path: Path) -> None:
    file = File(tmp_path / "whole.mcap", {})
    for number in range(100):
        file.write(TOPIC, str(number).encode(), number, number)
        if number % 10 == 9:
            file.flush()
    file.finish()
    whole = file.path.read_bytes()
    damaged = tmp_path / "damaged.mcap"
    for at in range(8, len(whole), 37):
        damaged.write_bytes(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
        assert len(list(Recording(damaged).messages())) <= 100


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    other = tmp_path / "other.mcap"
    other.write_text("not at all a recording")
    for path, why in ((other, "it is no MCAP file"), (tmp_path / "none", "No such file or directory")):
        with pytest.raises(Exception, match=why):
            list(Recording(path).messages())


def test_a_missing_package_is_named_with_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    with pytest.raises(NotSupportedError, match=r"pip install 'ual-daemon\[record\]'"):
        requirements.require("ual-daemon[record]")
