"""Tables on a terminal."""

from __future__ import annotations

from collections import Counter

import pytest

from ual_tools.tables import print_table


def test_a_narrow_terminal_cuts_nothing(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """`LANDED_…` would be either of two states."""
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "45")
    row = ("uav_1", "LANDED_DISARMED", "mavlink", "10.0.0.11:50051", "100 %")
    print_table(("uav", "state", "backend", "address", "battery"), [row])
    assert Counter("".join(row)) <= Counter(capsys.readouterr().out)
