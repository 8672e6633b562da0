"""The page of `ual view`, served as users serve it: by the command, in a process of its own."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.conftest import LIMIT_S, daemon_environment
from tests.forkserver import ForkedProcess, start_ual

StartView = Callable[..., str]
Views = list[ForkedProcess]


@pytest.fixture
def views() -> Iterator[Views]:
    """The processes that `start_view` has started."""
    started: Views = []
    yield started
    for each in started:
        each.kill()
        each.wait(LIMIT_S)


@pytest.fixture
def start_view(runtime_dir: Path, views: Views) -> StartView:
    """Starts ``ual --json view`` with these arguments on any free port; returns the address of the page."""
    pytest.importorskip("viser", reason="NO VISER, `ual view` is NOT TESTED: pip install 'ual-tools[view]'")

    def start(*arguments: str) -> str:
        reads, writes = os.pipe()
        words = ("--json", "view", "--port", "0", *arguments)
        try:
            assert sys.__stderr__ is not None
            errors = sys.__stderr__.fileno()
            views.append(start_ual(words, daemon_environment(runtime_dir), stdout=writes, stderr=errors))
        finally:
            os.close(writes)
        with os.fdopen(reads) as output:
            return str(json.loads(output.readline())["url"])

    return start
