"""A value, and when it was received."""

from __future__ import annotations

from typing import Generic, TypeVar

from ual.shared.immutable import immutable

T_co = TypeVar("T_co", covariant=True)

NEVER_S = float("-inf")
"""The time of a sample that will come but has not come yet. (None instead of a sample means that none will come.)"""


@immutable
class Sample(Generic[T_co]):
    """A value with the time (backend clock) at which it was received."""

    value: T_co
    time_s: float
