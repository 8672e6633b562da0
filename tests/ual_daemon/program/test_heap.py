"""The allocator of a daemon that runs for days."""

from __future__ import annotations

import asyncio
import ctypes
from types import SimpleNamespace

import pytest

from ual_daemon.program import heap


def test_free_pages_go_back_again_and_again(monkeypatch: pytest.MonkeyPatch) -> None:
    trimmed: list[int] = []

    def trim(pad: int) -> None:
        trimmed.append(pad)
        if len(trimmed) == 3:
            raise asyncio.CancelledError

    monkeypatch.setattr(heap, "_TRIM_PERIOD_S", 0.0)
    monkeypatch.setattr(ctypes, "CDLL", lambda _: SimpleNamespace(malloc_trim=trim))
    with pytest.raises(asyncio.CancelledError):
        asyncio.run(heap.keep_trimmed())
    assert trimmed == [0, 0, 0]


def test_another_c_library_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ctypes, "CDLL", lambda _: SimpleNamespace())
    heap.limit()
    asyncio.run(heap.keep_trimmed())
