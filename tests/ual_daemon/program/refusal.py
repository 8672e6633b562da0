"""Texts of ``ual-daemon`` when it refuses its flags."""

from __future__ import annotations

from collections.abc import Mapping

from tests import forkserver
from tests.conftest import LIMIT_S


def refused(flags: tuple[str, ...], environment: Mapping[str, str]) -> str:
    """Returns the one line of a daemon that ends with exit status 2."""
    refusing = forkserver.start(flags, environment)
    with refusing.stderr:
        said = refusing.stderr.read()
    assert refusing.wait(LIMIT_S) == 2, said
    (line,) = said.splitlines()
    return line
