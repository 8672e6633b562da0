"""A log that grows in a file: whole or not there, where it goes on, and what does not get into it."""

from __future__ import annotations

import hashlib
import random
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from ual.errors import InvalidArgumentError, LinkLostError, UalError
from ual.logs import Log, LogChunk, PartialFile, fetch, file_name
from ual.logs.files import OVERLAP

CONTENT = random.Random(3).randbytes(50_000)
LOG = Log("2026-11-25/13_22_11.ulg", len(CONTENT), 1_800_000_000.0)
PIECE = 7_000


class Logs:
    """Gives a log piece by piece. `breaks_at`: the link breaks there."""

    def __init__(self, content: bytes = CONTENT, log: Log = LOG, breaks_at: int | None = None) -> None:
        self.content = content
        self.log = log
        self.breaks_at = breaks_at
        self.sha256 = ""
        """The hash that is told, if not the right one."""
        self.offsets: list[int] = []

    def download(self, log_id: str, offset: int = 0) -> Iterator[LogChunk]:
        assert log_id == self.log.id
        self.offsets.append(offset)
        whole = self.content[offset:]
        for at in range(offset, max(len(self.content), offset + 1), PIECE):
            if self.breaks_at is not None and at >= self.breaks_at:
                raise LinkLostError("the link is lost")
            data = self.content[at : at + PIECE]
            is_last = at + PIECE >= len(self.content)
            yield LogChunk(self.log, at, data, (self.sha256 or hashlib.sha256(whole).hexdigest()) if is_last else "")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "flight.ulg"


def names(file: Path) -> list[str]:
    return sorted(each.name for each in file.parent.iterdir())


def test_a_log_is_whole_in_its_file_and_nothing_else_is_left(file: Path) -> None:
    seen: list[tuple[int, int]] = []
    assert fetch(Logs(), LOG, file, lambda *progress: seen.append(progress)) == hashlib.sha256(CONTENT).hexdigest()
    assert file.read_bytes() == CONTENT
    assert names(file) == ["flight.ulg"]
    assert seen[-1] == (len(CONTENT), len(CONTENT))
    assert len(seen) == 8


def test_an_empty_log_is_an_empty_file(file: Path) -> None:
    empty = replace(LOG, size_bytes=0)
    assert fetch(Logs(b"", empty), empty, file) == hashlib.sha256(b"").hexdigest()
    assert file.read_bytes() == b""


def test_after_a_broken_link_it_goes_on_where_it_was(file: Path) -> None:
    logs = Logs(breaks_at=30_000)
    with pytest.raises(LinkLostError):
        fetch(logs, LOG, file)
    assert names(file) == ["flight.ulg.part", "flight.ulg.part.json"]
    logs.breaks_at = None
    assert fetch(logs, LOG, file) == hashlib.sha256(CONTENT).hexdigest()
    assert logs.offsets == [0, 35_000 - OVERLAP]
    assert file.read_bytes() == CONTENT


def test_a_part_that_was_cut_off_anywhere_goes_on(file: Path) -> None:
    for size in (0, 1, OVERLAP - 1, OVERLAP, OVERLAP + 1, len(CONTENT) - 1, len(CONTENT)):
        with pytest.raises(LinkLostError):
            fetch(Logs(breaks_at=0), LOG, file)
        file.with_name("flight.ulg.part").write_bytes(CONTENT[:size])
        logs = Logs()
        assert fetch(logs, LOG, file) == hashlib.sha256(CONTENT).hexdigest()
        assert logs.offsets == [max(0, size - OVERLAP)]
        assert file.read_bytes() == CONTENT


@pytest.mark.parametrize(
    "other",
    [
        replace(LOG, size_bytes=60_000, time_s=None),
        replace(LOG, size_bytes=49_000),
        replace(LOG, time_s=1.0),
        replace(LOG, time_s=None),
        replace(LOG, id="7"),
    ],
)
def test_no_other_log_is_glued_to_what_is_there(file: Path, other: Log) -> None:
    with pytest.raises(LinkLostError):
        fetch(Logs(breaks_at=30_000), LOG, file)
    content = random.Random(4).randbytes(other.size_bytes)
    logs = Logs(content, other)
    assert fetch(logs, other, file) == hashlib.sha256(content).hexdigest()
    assert logs.offsets == [0]
    assert file.read_bytes() == content


def test_a_log_that_has_grown_since_it_was_cut_off_goes_on_where_it_was(file: Path) -> None:
    with pytest.raises(LinkLostError):
        fetch(Logs(breaks_at=30_000), LOG, file)
    grown = CONTENT + random.Random(6).randbytes(9_000)
    longer = replace(LOG, size_bytes=len(grown))
    logs = Logs(grown, longer)
    assert fetch(logs, longer, file) == hashlib.sha256(grown).hexdigest()
    assert logs.offsets == [35_000 - OVERLAP]
    assert file.read_bytes() == grown


def test_another_log_of_the_same_name_size_and_time_is_found_out(file: Path) -> None:
    with pytest.raises(LinkLostError):
        fetch(Logs(breaks_at=30_000), LOG, file)
    with pytest.raises(UalError, match=r"differs from what is in .*flight.ulg.part: remove that"):
        fetch(Logs(random.Random(4).randbytes(len(CONTENT))), LOG, file)
    assert not file.exists()


def test_a_log_that_becomes_another_one_meanwhile_is_refused(file: Path) -> None:
    with pytest.raises(UalError, match="is another log now"):
        fetch(Logs(log=replace(LOG, time_s=5.0)), LOG, file)


def test_a_log_that_has_grown_meanwhile_is_fetched_as_long_as_it_was_listed(file: Path) -> None:
    grown = CONTENT + b"more"
    assert fetch(Logs(grown, replace(LOG, size_bytes=len(grown))), LOG, file) == hashlib.sha256(CONTENT).hexdigest()
    assert file.read_bytes() == CONTENT


def test_a_wrong_hash_a_hole_and_a_missing_end_are_errors(file: Path) -> None:
    logs = Logs()
    logs.sha256 = "0" * 64
    with pytest.raises(UalError, match="the hash of what has come is wrong"):
        fetch(logs, LOG, file)
    with PartialFile(file, LOG) as part, pytest.raises(UalError, match="have not come"):
        part.add(LogChunk(LOG, len(CONTENT) + 1, b"x"))
    with PartialFile(file, replace(LOG, time_s=2.0)) as part, pytest.raises(UalError, match="is not whole"):
        part.finish()
    assert not file.exists()


def test_a_file_that_cannot_be_written_is_an_error_before_anything_is_requested(tmp_path: Path) -> None:
    logs = Logs()
    with pytest.raises(InvalidArgumentError, match="cannot write"):
        fetch(logs, LOG, tmp_path / "nowhere" / "flight.ulg")
    assert logs.offsets == []


def test_a_file_that_was_there_stays_until_the_new_one_is_whole(file: Path) -> None:
    file.write_bytes(b"old")
    with pytest.raises(LinkLostError):
        fetch(Logs(breaks_at=30_000), LOG, file)
    assert file.read_bytes() == b"old"
    fetch(Logs(), LOG, file)
    assert file.read_bytes() == CONTENT


@pytest.mark.parametrize(
    ("log_id", "name"),
    [
        ("2026-11-25/13_22_11.ulg", "uav_1_2026-11-25_13_22_11.ulg"),
        ("00000007.BIN", "uav_1_00000007.BIN"),
        ("7", "uav_1_log_7"),
        ("../../etc/passwd", "uav_1_.._.._etc_passwd"),
        ("a b\n.ulg", "uav_1_a_b_.ulg"),
    ],
)
def test_the_name_of_the_file_is_one_on_every_system(log_id: str, name: str) -> None:
    assert file_name(Log(log_id, 1), "uav_1") == name
