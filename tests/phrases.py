"""Finds phrases of a private dialect in comments and docstrings: ``python -m tests.phrases`` lists them with proposals.

Programs and devices are *it* and have names; *who* is for persons. It looks at the files that are named, or at all.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from tests.sentences import COMMENTS, ROOT, Sentence, of_contract, of_docstrings, of_module, outline
from tests.sentences import files as all_files

_PERSON = r"(?<!pilot )(?<!pilots )(?<!operator )(?<!operators )(?<!person )(?<!people )(?<!user )(?<!users )"
PROPOSALS = {
    r"\b(?:he|him|his)\b": "name the person, or write *it* of a program: 'as with a transmitter'",
    _PERSON + r"\bwho(?:m|ever)?\b(?!-)": "name the thing: 'Returns the holder of the lease.', 'the caller that …'",
    r"\bas ever\b": "say what is unchanged: 'continues to …'",
    r"\bat an end\b": "'has ended'",
    r"\bgives? way\b": "'yields', 'moves aside'",
    r"\bmend(?:s|ed)?\b": "'fixes', 'restores', 'recovers'",
    r"\bfor people\b": "'human-readable'",
}
_FOUND = re.compile("|".join(f"(?P<p{number}>{each})" for number, each in enumerate(PROPOSALS)), re.IGNORECASE)
_SUSPECT = re.compile(r"\b(?:he|him|his|who|whom|whoever|ever|end|way|mend\w*|people)\b", re.IGNORECASE)


class Phrase(NamedTuple):
    """A phrase that is not used: the line of its paragraph, the words, and a proposal."""

    line: int
    words: str
    proposal: str


def of_text(text: str, *, is_contract: bool = False) -> list[Phrase]:
    """Returns the phrases in the comments and docstrings of a module, or in the comments of a ``.proto`` file."""
    if not _SUSPECT.search(text):
        return []  # to parse takes most of the time
    sentences = of_contract(text) if is_contract else [*_of_module(text), *_code_free(text)]
    return sorted({Phrase(line, *found) for line, said in sentences for found in _phrases(said)})


def _of_module(text: str) -> list[Sentence]:
    """Returns its sentences, those of comments only where one has such a word: to find them takes long."""
    is_suspect = any(_SUSPECT.search(block[0]) for block in COMMENTS.finditer(text))
    return of_module(text) if is_suspect else of_docstrings(text)


def _code_free(text: str) -> Iterator[tuple[int, str]]:
    """Yields the docstrings, also the parts that are no sentences, such as the descriptions of arguments."""
    yield from ((line, re.sub(r"`[^`]*`", "", " ".join(said.split()))) for line, said in outline(text).docstrings)


def _phrases(sentence: str) -> Iterator[tuple[str, str]]:
    for found in _FOUND.finditer(sentence):
        yield found[0], list(PROPOSALS.values())[int(str(found.lastgroup)[1:])]


def files() -> list[Path]:
    """Returns the modules and the contract."""
    return [path for path in all_files() if path.suffix in (".py", ".proto") and not path.stem.endswith("phrases")]


def all_found(paths: Iterable[Path] | None = None) -> list[str]:
    """Returns, human-readable, the phrases of these files (None: of all) with proposals."""
    checked = files() if paths is None else paths
    return [
        f"{path.relative_to(ROOT).as_posix()}:{each.line}: not `{each.words}` but: {each.proposal}"
        for path in checked
        for each in of_text(path.read_text(encoding="utf-8"), is_contract=path.suffix == ".proto")
    ]


def main() -> None:
    """Prints the phrases."""
    print(*all_found([Path(name).resolve() for name in sys.argv[1:]] or None), sep="\n")


if __name__ == "__main__":
    main()
