"""Old name of `command_entrance`, until 0.4."""

from __future__ import annotations

import warnings

from ual_daemon.backends.engine.command_entrance import CommandEntrance


def __getattr__(name: str) -> object:
    if name == "CommandDesk":
        text = "command_desk.CommandDesk is command_entrance.CommandEntrance since 0.3; the old name ends with 0.4"
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return CommandEntrance
    raise AttributeError(name)
