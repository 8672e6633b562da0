"""The figures that were recorded last, in ``recorded.json``: of `make bench` (``--keep``)."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

_FILE = Path(__file__).parent / "recorded.json"


def recorded(part: str) -> dict[str, Any]:
    """Returns a part of the file, by the names of its lines; empty where it has none."""
    found: dict[str, Any] = _all().get(part, {})
    return found


def record(part: str, lines: Mapping[str, object]) -> None:
    """Replaces a part of the file."""
    _FILE.write_text(json.dumps({**_all(), part: dict(lines)}, indent=2) + "\n")


def _all() -> dict[str, Any]:
    return json.loads(_FILE.read_text()) if _FILE.exists() else {}
