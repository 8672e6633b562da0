"""A motion that may begin."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from ual.types import Plan

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Prepared(Generic[T]):
    """A motion that has passed all checks: what it would be, and what begins it. Nothing has happened yet.

    `begin` is to be called at once, and once.
    """

    plan: Plan
    begin: Callable[[], T]
