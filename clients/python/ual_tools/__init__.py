"""The ``ual`` command, which flies a UAV from a terminal or a script. See ``docs/reference/cli.md``."""

from __future__ import annotations

__version__ = "0.3.0.dev0"
