"""Worker that makes pictures one after another: the number that wait, also where the computer has no thread for
them.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest

from tests.conftest import LIMIT_S
from ual_daemon.backends.engine.picture_worker import MOST_WAITING_PICTURES, PictureWorker


def test_a_picture_for_which_there_is_no_thread_takes_no_room(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("can't start new thread")

    worker = PictureWorker("pictures")
    with monkeypatch.context() as full:
        full.setattr(ThreadPoolExecutor, "submit", fail)
        for _ in range(MOST_WAITING_PICTURES):
            with pytest.raises(RuntimeError):
                worker.submit(lambda: b"")
    assert worker.submit(lambda: b"png").result(LIMIT_S) == b"png"
    worker.close()
