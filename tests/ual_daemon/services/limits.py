"""Other time limits than the contract's, for tests."""

from __future__ import annotations

import pytest

from ual.contract.methods import METHODS


def limit(monkeypatch: pytest.MonkeyPatch, method: str, limit_s: float) -> None:
    """Changes how long the daemon works on a method, for one test."""
    monkeypatch.setitem(METHODS, method, METHODS[method]._replace(limit_s=limit_s))
