"""Snapshots for tests."""

from __future__ import annotations

from typing import Any

from ual_daemon.backends.values import Snapshot

_GROUPS = ("control", "motion", "earth", "condition", "link")


def changed(snapshot: Snapshot, **values: Any) -> Snapshot:
    """Returns a snapshot with other values, in whichever group each of them is."""
    for name, value in values.items():
        group = _group_of(snapshot, name)
        inner = {name: value} if group is None else {group: getattr(snapshot, group)._replace(**{name: value})}
        snapshot = snapshot._replace(**inner)
    return snapshot


def value_of(snapshot: Snapshot, name: str) -> Any:
    """Returns a value, in whichever group it is."""
    group = _group_of(snapshot, name)
    return getattr(snapshot if group is None else getattr(snapshot, group), name)


def _group_of(snapshot: Snapshot, name: str) -> str | None:
    return next((group for group in _GROUPS if hasattr(getattr(snapshot, group), name)), None)
