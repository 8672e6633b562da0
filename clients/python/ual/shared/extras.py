"""Says which extra to install where a package is missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ual.errors import NotSupportedError


@contextmanager
def needs(what: str, extra: str) -> Iterator[None]:
    """Says that `what` needs an extra, such as ``ual-tools[view]``, if an import in the block fails.

    Raises:
        NotSupportedError: An import failed.

    """
    try:
        yield
    except ImportError as error:
        raise NotSupportedError(f"{what} needs {error.name}: install the extra by pip install '{extra}'") from None
