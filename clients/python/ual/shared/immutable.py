"""Immutable values of which each update makes many."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

from typing_extensions import dataclass_transform

T = TypeVar("T")


@dataclass_transform(frozen_default=True)
def immutable(cls: type[T]) -> type[T]:
    """Makes a class a dataclass with slots whose fields nobody sets: mypy refuses it, nothing checks at run time.

    A frozen dataclass checks, too, and therefore sets each of its fields by a call: making one takes 2.5 to
    4 times as many instructions.
    """
    return dataclass(slots=True, unsafe_hash=True)(cls)
