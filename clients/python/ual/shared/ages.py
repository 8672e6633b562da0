"""Texts that have not changed although the age that they tell has grown."""

from __future__ import annotations

import re

_SECONDS = re.compile(r"\b[0-9]+(?:\.[0-9]+)? s\b")


def without_seconds(text: str) -> str:
    """Returns a text without its numbers of seconds: ``nothing heard for 2.6 s`` says no more than ``2.7 s``."""
    return _SECONDS.sub("s", text)
