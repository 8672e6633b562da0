"""Old name of `command_snapshot`, until 0.4."""

from __future__ import annotations

import warnings

from ual_daemon.backends import command_snapshot

_NEW_NAMES = {"judged": "command_snapshot", "judged_by": "call_with_snapshot"}


def __getattr__(name: str) -> object:
    if name in _NEW_NAMES:
        text = f"judged.{name} is command_snapshot.{_NEW_NAMES[name]} since 0.3; the old name ends with 0.4"
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return getattr(command_snapshot, _NEW_NAMES[name])
    raise AttributeError(name)
