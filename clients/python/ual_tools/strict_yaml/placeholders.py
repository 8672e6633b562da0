"""Fills ``{index}``, ``{14539+index}``, ``{ns}`` and the like into the texts of a team's file.

Sums and products of `index` with whole numbers are all the arithmetic there is. Ports, system ids and places in a row
need no more, and a text of the file can do nothing else.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from ual_tools.help import close, did_you_mean

_BRACES = re.compile(r"\{\{|\}\}|\{([^{}]*)\}|[{}]")
_OF_INDEX = re.compile(r"(?:(?P<before>-?\d+)\+)?(?:(?P<times>-?\d+)\*)?index(?:(?P<after>[+-]\d+))?")


class PlaceholderError(ValueError):
    """A text has a placeholder that does not exist."""


def fill(text: str, values: Mapping[str, str]) -> str:
    """Returns the text with all placeholders replaced; ``{{`` and ``}}`` stand for braces.

    Raises:
        PlaceholderError: There is no such placeholder, or a brace stands alone.
    """
    return _BRACES.sub(lambda match: _value(match[0], match[1], values), text)


def is_one(text: str) -> bool:
    """Returns whether the text is nothing but one number made of `index`: what it gives is a number, too."""
    match = _BRACES.fullmatch(text)
    return match is not None and match[1] is not None and _OF_INDEX.fullmatch(_bare(match[1])) is not None


def _value(braces: str, inner: str | None, values: Mapping[str, str]) -> str:
    if inner is None:
        if len(braces) == 1:
            raise PlaceholderError(f"a {braces} stands alone; write {braces * 2} for the character")
        return braces[0]
    if inner in values:
        return values[inner]
    number = _OF_INDEX.fullmatch(_bare(inner))
    if number is None or "index" not in values:
        known = sorted(values)
        raise PlaceholderError(
            f"{braces}: there is no such placeholder ({', '.join(f'{{{name}}}' for name in known)}); write "
            f"{{{braces}}} for the characters.{did_you_mean(close(inner, known))}"
        )
    result = int(number["before"] or 0) + int(number["times"] or 1) * int(values["index"]) + int(number["after"] or 0)
    return str(result)


def _bare(text: str) -> str:
    return text.replace(" ", "")
