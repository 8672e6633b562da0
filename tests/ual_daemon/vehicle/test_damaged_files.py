"""Files that a daemon finds at its start, and that a disk or a person has damaged: they are logged, and ignored."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

import pytest

from ual_daemon.frames.home_file import HomeFile
from ual_daemon.vehicle.mission_file import MissionFile
from ual_daemon.vehicle.upload_journal import JournalFile

_HUGE = "9" * 400
DAMAGED = ("", "{", "[]", "null", '"text"', "[" * 2000, '{"vehicle": 1}', "\x00\x01")
HOME = '{"vehicle": "v", "home": null, "start": null, "saved_s": %s}'
MISSION = '{"vehicle": "v", "digest": "d", "task_id": "t", "paused_at": %s}'
UPLOAD = '[{"list": "mission", "vehicle": "v", "items_count": 1, "began_s": %s}]'


@pytest.mark.parametrize(
    ("read", "texts", "event"),
    [
        (lambda path: HomeFile(path).read(), (HOME % _HUGE, HOME % "NaN"), "home_file_ignored"),
        (lambda path: MissionFile(path).read(), (MISSION % "1e999", MISSION % "NaN"), "mission_file_ignored"),
        (lambda path: JournalFile(path).read() or None, (UPLOAD % "1e999", UPLOAD % _HUGE), "uploads_file_ignored"),
    ],
    ids=["home", "mission", "uploads"],
)
def test_a_damaged_file_is_ignored(
    read: Callable[[Path], object],
    texts: tuple[str, ...],
    event: str,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
) -> None:
    path = tmp_path / "file"
    for text in (*DAMAGED, *texts):
        path.write_text(text)
        with caplog.at_level(logging.WARNING):
            caplog.clear()
            assert read(path) is None, text[:40]
            assert event in caplog.text or text == "[]", text[:40]  # which is a journal without uploads
