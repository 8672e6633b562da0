"""The version of the daemon. Below everything, so that any room may say it."""

from __future__ import annotations

__version__ = "0.3.0.dev0"
