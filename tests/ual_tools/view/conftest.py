"""The page of `ual view`, served as users serve it: by the command, in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.conftest import LIMIT_S, daemon_environment

_MAIN = "from ual_tools.main import main; main()"

StartView = Callable[..., str]
Views = list[subprocess.Popen[str]]


@pytest.fixture
def views() -> Iterator[Views]:
    """The processes that `start_view` has started."""
    started: Views = []
    yield started
    for each in started:
        each.kill()
        each.wait(LIMIT_S)
        assert each.stdout is not None
        each.stdout.close()


@pytest.fixture
def start_view(runtime_dir: Path, views: Views) -> StartView:
    """Starts ``ual --json view`` with these arguments on any free port; returns the address of the page."""
    pytest.importorskip("viser", reason="NO VISER, `ual view` is NOT TESTED: pip install 'ual-tools[view]'")

    def start(*arguments: str) -> str:
        process = subprocess.Popen(
            [sys.executable, "-c", _MAIN, "--json", "view", "--port", "0", *arguments],
            env=daemon_environment(runtime_dir),
            stdout=subprocess.PIPE,
            text=True,
        )
        views.append(process)
        assert process.stdout is not None
        return str(json.loads(process.stdout.readline())["url"])

    return start
