"""The listeners of a vehicle."""

from __future__ import annotations

from ual_daemon.vehicle.listeners import Listeners


def test_a_listener_is_there_until_it_is_removed() -> None:
    listeners: Listeners[str] = Listeners()
    remove_first, _ = listeners.add("first"), listeners.add("second")
    assert list(listeners) == ["first", "second"]
    remove_first()
    remove_first()
    assert list(listeners) == ["second"]


def test_a_listener_may_be_removed_during_an_iteration() -> None:
    listeners: Listeners[str] = Listeners()
    remove_first, _ = listeners.add("first"), listeners.add("second")
    seen = []
    for listener in listeners:
        seen.append(listener)
        remove_first()
    assert seen == ["first", "second"]
