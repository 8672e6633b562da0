"""The public interface for Python keeps what programs rely on."""

from __future__ import annotations

from tests.interface import REMEDY, found, recorded


def test_public_names_and_signatures_are_kept() -> None:
    now = {name: each.signature for name, each in found().items()}
    kept = recorded()
    assert kept, "make interface"
    lost = {
        name: (signature, now.get(name, "is gone")) for name, signature in kept.items() if now.get(name) != signature
    }
    assert not lost, REMEDY
