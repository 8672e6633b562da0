"""The calls that are more than a request and its response."""

from __future__ import annotations
