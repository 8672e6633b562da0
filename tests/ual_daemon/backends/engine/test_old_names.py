"""Old names of the engine, for backends of third parties: they warn, and end with 0.4."""

from __future__ import annotations

import importlib
from typing import Any
from unittest.mock import Mock

import pytest

from ual_daemon.backends import command_snapshot
from ual_daemon.backends.engine.command_entrance import CommandEntrance
from ual_daemon.backends.engine.command_runner import CommandRunner
from ual_daemon.backends.engine.link_watch import LinkWatch
from ual_daemon.backends.engine.loop import Loop


@pytest.mark.parametrize(
    ("module", "old_name", "new"),
    [
        ("engine.command_desk", "CommandDesk", CommandEntrance),
        ("judged", "judged", command_snapshot.command_snapshot),
        ("judged", "judged_by", command_snapshot.call_with_snapshot),
    ],
)
def test_a_module_has_its_old_names(module: str, old_name: str, new: object) -> None:
    old: Any = importlib.import_module(f"ual_daemon.backends.{module}")
    with pytest.warns(DeprecationWarning, match=f"{old_name} is .* since 0.3"):
        assert getattr(old, old_name) is new
    with pytest.raises(AttributeError):
        _ = old.no_such_name


def test_a_class_has_its_old_names() -> None:
    given: Any = Loop.give
    on_heard: Any = LinkWatch.on_heard
    assert (given.__wrapped__, on_heard.__wrapped__) == (Loop.run_on_loop, LinkWatch.on_message)
    old = CommandRunner.__dict__["is_any_under_way"]
    with pytest.warns(DeprecationWarning, match="is_any_pending"):
        assert old.fget(Mock(_waiting=[], _in_flight={})) is False
