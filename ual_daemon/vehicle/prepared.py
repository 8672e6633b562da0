"""A command that has passed its checks and may begin."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from ual.types import Plan

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Prepared(Generic[T]):
    """A command that has passed its checks: its plan, and the function that begins it. Nothing has begun yet.

    Call `begin` at once, and only once.
    """

    plan: Plan
    begin: Callable[[], T]
