"""Names and documents a function that is made of another one."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])


def _same(result: str) -> str:
    return result


def described(made: F, source: Callable[..., Any], result: Callable[[str], str] = _same) -> F:
    """Gives `made` the name, documentation and signature of `source`; `result` makes the type that it returns."""
    functools.update_wrapper(made, source)
    signature = inspect.signature(source)
    returned = result(str(signature.return_annotation))
    made.__annotations__ = {**made.__annotations__, "return": returned}  # what documentation reads
    made.__signature__ = signature.replace(return_annotation=returned)  # type: ignore[attr-defined] # (functions take any)
    return made
