"""The server does the same on each transport: tests here that ask for `transport`, or start a daemon, run on both."""

from __future__ import annotations

from functools import partial

import pytest

from tests.conftest import StartDaemon
from ual_daemon.server.transport.selection import Choice


@pytest.fixture(params=["core", "aio"])
def transport(request: pytest.FixtureRequest) -> Choice:
    choice: Choice = request.param
    return choice


@pytest.fixture
def start_daemon(start_daemon: StartDaemon, transport: Choice) -> StartDaemon:
    return partial(start_daemon, "--transport", transport)
