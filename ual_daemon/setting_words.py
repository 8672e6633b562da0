"""Says in words what is wrong with a setting, where msgspec quotes a regular expression or names no other value."""

from __future__ import annotations

import re
import typing
from collections.abc import Iterable, Iterator
from enum import Enum
from typing import Any

import msgspec

_NAME = "a name: letters, digits and _, beginning with a letter or _"
_PATTERN = re.compile(r"Expected `str` matching regex '(.*)'")
_LEAST_ALIKE = 0.75


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Returns the question after names that are spelled in a similar way; empty where there are none."""
    import difflib  # imported late, for a faster start

    alike = difflib.get_close_matches(word, list(known), n=3, cutoff=_LEAST_ALIKE)
    return f"; did you mean {' or '.join(alike)}?" if alike else ""


def in_words(message: str, kind: type[msgspec.Struct], key: str) -> str:
    """Returns the message of msgspec about the value of a key (``frames[0].frame_id``), as a person reads it."""
    if pattern := _PATTERN.fullmatch(message):
        length = re.search(r"\{0,(\d+)\}", pattern[1])
        at_most = f", of at most {int(length[1]) + 1} characters" if length else ""
        return f"expected {_NAME}{at_most}" + (", parts joined by /" if "/" in pattern[1] else "")
    if message.startswith("Invalid enum value"):
        known = list(_values(_type_at(kind, key)))
        return f"{message.removeprefix('Invalid enum value ')} is not one of: {', '.join(known)}"
    return message


def keys(kind: Any) -> Iterator[str]:  # noqa: ANN401 (a type, or what stands for one in an annotation)
    """Yields the keys of a section and of those inside it, with their dots."""
    for name, annotation in typing.get_type_hints(_struct(kind)).items():
        yield name
        if _struct(annotation) is not None:
            yield from (f"{name}.{inner}" for inner in keys(annotation))


def _type_at(kind: Any, key: str) -> Any:  # noqa: ANN401 (see `keys`)
    for name in re.sub(r"\[[^]]*\]", "", key).split("."):
        kind = typing.get_type_hints(_struct(kind))[name]
    return kind


def _struct(annotation: Any) -> type[msgspec.Struct] | None:  # noqa: ANN401 (see `keys`)
    """Returns the section that an annotation allows: by itself, in a union, or in a tuple."""
    if isinstance(annotation, type) and issubclass(annotation, msgspec.Struct):
        return annotation
    return next((found for each in typing.get_args(annotation) if (found := _struct(each)) is not None), None)


def _values(annotation: Any) -> Iterator[str]:  # noqa: ANN401 (see `keys`)
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        yield from (str(each.value) for each in annotation)
    elif typing.get_origin(annotation) is typing.Literal:
        yield from map(str, typing.get_args(annotation))
    elif annotation is float:
        yield "a number"
    else:
        for each in typing.get_args(annotation):
            yield from _values(each)
