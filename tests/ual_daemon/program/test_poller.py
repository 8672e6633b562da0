"""Poller of gRPC that reads the sockets: docs/evidence/decisions/0010 and 0020."""

from __future__ import annotations

import os
import subprocess
import sys
from types import SimpleNamespace
from typing import Any

import pytest

from ual_daemon.program import main


@pytest.mark.parametrize(
    ("transport", "listen", "is_older"),
    [
        ("core", ["127.0.0.1:0"], True),
        ("auto", ["localhost:50051", "unix:/run/ual.sock", "[::1]:{port}", "unix:/run/ual/{ns}.sock"], True),
        ("auto", ["127.0.0.1:0", "0.0.0.0:50051"], False),
        ("auto", ["uav.example:50051"], False),
        ("auto", ["no address"], False),
        ("aio", ["127.0.0.1:0"], False),
    ],
)
def test_the_older_poller_serves_only_callers_of_this_computer(
    monkeypatch: pytest.MonkeyPatch, transport: str, listen: list[str], *, is_older: bool
) -> None:
    monkeypatch.setenv("GRPC_EXPERIMENTS", "")
    del os.environ["GRPC_EXPERIMENTS"]
    configuration: Any = SimpleNamespace(daemon=SimpleNamespace(transport=transport), listen=listen)
    main._choose_poller(configuration)
    assert os.environ.get("GRPC_EXPERIMENTS") == ("-event_engine_listener" if is_older else None)


def test_who_sets_it_by_hand_is_queried_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GRPC_EXPERIMENTS", "mine")
    configuration: Any = SimpleNamespace(daemon=SimpleNamespace(transport="core"), listen=["127.0.0.1:0"])
    main._choose_poller(configuration)
    assert os.environ["GRPC_EXPERIMENTS"] == "mine"


def test_the_addresses_are_known_before_grpc_is_imported() -> None:
    """It reads its experiments once."""
    code = (
        "import sys; from ual_daemon.program import main; from ual_daemon.backends import registry; "
        "from ual_daemon.program.configuration import resolve; resolve([], registry.NAMES); "
        "from ual_daemon.server import addresses; sys.exit('grpc' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
