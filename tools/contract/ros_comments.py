"""Comments of the contract as ROS has them: without units in the names, and with numbers for what is not set."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping, Sequence

from google.protobuf.descriptor_pb2 import FileDescriptorSet

from tools.contract.comments import comments as comments_of

WIDTH = 120
COLUMN = 27
"""Column at which a comment beside a field begins."""
BY_TOOL = "# `make proto` writes this file: do not edit."


def comments(contract: FileDescriptorSet, names: Mapping[str, str]) -> dict[str, str]:
    """Returns the comments of messages, fields and methods, by their full names, each in one line.

    Names of methods and fields are those that ROS has instead.
    """
    found = {
        f"{file.package}.{name}": " ".join(text.split())
        for file in contract.file
        for name, text in comments_of(file).items()
        if text
    }
    other = re.compile(rf"`?(?:\w+Service\.)?\b({'|'.join(sorted(names, key=len, reverse=True))})\b`?")
    return {
        name: other.sub(lambda each: f"`{names[each[1]]}`", text.removeprefix("TASK. ")) for name, text in found.items()
    }


def trailing(*parts: str) -> str:
    """Returns a comment beside a field: parts in one line, without a capital and without a full stop."""
    return "; ".join(_small(re.sub(r"(?<!\.)\.$", "", each)) for each in parts if each)


def unset(text: str, word: str) -> str:
    """Returns a comment with what ROS has where the contract sets nothing."""
    capital = word[:1].upper() + word[1:]
    text = re.sub(r"\b(?:Not (?:set|given)|Absent)\b", capital, text)
    return re.sub(r"\b(?:not (?:set|given)|absent)\b", word, text)


def without_unit(text: str) -> str:
    """Returns a comment without the unit that the declaration says already."""
    return re.sub(r",(?: in)? (?:m|s|rad|m/s)(?=[.;,]|$)", "", text)


def without_unset(text: str) -> str:
    """Returns a comment without the sentences about what is not set."""
    sentences = re.split(r"(?<=[.:]) (?=[A-Z])", text)
    return " ".join(each for each in sentences if not re.search(r"\b[Nn]ot set\b", each))


def listed(names: Sequence[str]) -> str:
    """Returns names as a sentence has them."""
    return f"{', '.join(names[:-1])} or {names[-1]}" if len(names) > 1 else "".join(names)


def head(text: str) -> list[str]:
    """Returns the lines of a comment that stands alone."""
    return textwrap.wrap(text, WIDTH, initial_indent="# ", subsequent_indent="# ", break_on_hyphens=False)


def declared(declaration: str, comment: str) -> list[str]:
    """Returns the lines of a field with its comment."""
    if not comment:
        return [declaration]
    start = f"{declaration:<{COLUMN}}# " if len(declaration) < COLUMN else f"{declaration}  # "
    lines = textwrap.wrap(comment, WIDTH - len(start), break_on_hyphens=False)
    return [
        start + lines[0],
        *(
            f"{'':{COLUMN}}# {each}"
            for each in textwrap.wrap(" ".join(lines[1:]), WIDTH - COLUMN - 2, break_on_hyphens=False)
        ),
    ]


def _small(text: str) -> str:
    word = text.partition(" ")[0]
    is_name = len(text) == 1 or any(each.isupper() or each in "_`." for each in word[1:].rstrip("."))
    return text if is_name else text[:1].lower() + text[1:]
