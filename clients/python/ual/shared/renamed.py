"""Old names of functions and properties, kept for one release."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")


def renamed(function: Callable[P, R], old_name: str) -> Callable[P, R]:
    """Returns the function under its old name: each call gives a `DeprecationWarning`."""

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        text = f"{old_name} is {function.__name__} since 0.3; the old name ends with 0.4"
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return function(*args, **kwargs)

    return call


def renamed_property(found: object, old_name: str) -> property:
    """Returns the property under its old name: each access gives a `DeprecationWarning`."""
    assert isinstance(found, property)
    assert found.fget is not None
    return property(renamed(found.fget, old_name), doc=found.__doc__)
