"""``ual check``: the conformance checks, run over one UAV."""

from __future__ import annotations

COMMANDS = ()
