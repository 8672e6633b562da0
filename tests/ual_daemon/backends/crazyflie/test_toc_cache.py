"""Tables of contents on disk, and a user without a home directory."""

from __future__ import annotations

from pathlib import Path

import pytest

from ual_daemon.backends.crazyflie.packets import LOG
from ual_daemon.backends.crazyflie.toc import TocCache, TocInfo, Variable

INFO = TocInfo(1, 0x1234)
TOC = {"pm.vbat": Variable(0, "f", False)}


def test_a_table_is_kept(tmp_path: Path) -> None:
    TocCache(str(tmp_path)).save(LOG, INFO, TOC)
    assert TocCache(str(tmp_path)).load(LOG, INFO) == TOC


def test_without_a_home_directory_nothing_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """A container may run with any user id."""
    for name in ("HOME", "XDG_CACHE_HOME", "CACHE_DIRECTORY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("pwd.getpwuid", {}.__getitem__)
    cache = TocCache()
    cache.save(LOG, INFO, TOC)
    assert cache.load(LOG, INFO) is None
