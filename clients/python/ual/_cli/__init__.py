"""The ``ual`` command, which flies a UAV from a terminal or a script. See ``docs/cli.md``."""

from __future__ import annotations

from ual._cli.main import cli, main

__all__ = ["cli", "main"]
