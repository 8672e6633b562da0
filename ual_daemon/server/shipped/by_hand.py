"""The methods that are more than unpack, call and pack."""

from __future__ import annotations
