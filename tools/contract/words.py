"""Names and comments of the contract, as Python writes them."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping

_WIDTH = 120
_UNSET = ((re.compile(r"\b[Ii]s not set\b"), "is None"), (re.compile(r"\b[Nn]ot set\b"), "None"))
_CODE = re.compile(r"`([^`]+)`")
_NAME = re.compile(r"[A-Za-z_][\w.]*")


def snake(name: str) -> str:
    """Returns the name of a class or a method as that of a function: ``order_winch`` of ``OrderWinch``."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name).lower()


def shouted(name: str) -> str:
    """Returns the name of a class as that of a constant."""
    return snake(name).upper()


def comment_text(comment: str, names: Mapping[str, str]) -> str:
    """Returns a comment of the contract as one line of a docstring. `names` has the classes of the messages."""
    text = " ".join(comment.split())
    for unset, none in _UNSET:
        text = unset.sub(none, text)
    return _CODE.sub(lambda found: _code(found[1], names), text)


def _code(code: str, names: Mapping[str, str]) -> str:
    known = names.get(code, code)
    return f"`{known}`" if _NAME.fullmatch(known) else f"``{known}``"


def docstring(text: str, arguments: Mapping[str, str] | None = None, indent: str = "    ") -> str:
    """Returns a docstring: its first sentence, the rest, and what its arguments are."""
    documented = {name: about for name, about in (arguments or {}).items() if about}
    if not documented and len(indent) + len(text) + 6 <= _WIDTH:
        return f'{indent}"""{text}"""\n'
    first, rest = _first_sentence(text, _WIDTH - len(indent) - 3)
    lines = [f'"""{first}']
    if rest:
        lines += ["", *_wrapped(rest, indent)]
    if documented:
        lines += ["", "Args:"]
        for name, about in documented.items():
            lines += _wrapped(f"    {name}: {about}", indent, further="        ")
        lines += [""]
    return "".join(f"{indent}{line}".rstrip() + "\n" for line in [*lines, '"""'])


def _first_sentence(text: str, width: int) -> tuple[str, str]:
    """Returns as many of the first sentences as one line has room for, and the others."""
    if len(text) <= width:
        return text, ""
    ends = [found.end() for found in re.finditer(r"\.(?= )", text) if found.end() <= width]
    if not ends:
        raise SystemExit(f"the first sentence does not fit into a line: {text}")
    return text[: ends[-1]], text[ends[-1] :].strip()


def _wrapped(text: str, indent: str, further: str = "") -> list[str]:
    return textwrap.wrap(
        text, _WIDTH - len(indent), subsequent_indent=further, break_long_words=False, break_on_hyphens=False
    )
