"""Counts the words of sentences in pages, comments and docstrings: ``python -m tests.sentences`` lists long ones.

It looks at the files that are named, or at all that are checked. Code, tables, pictures and addresses are no sentences.
A piece of code within a sentence is one word, a link is the words that are read.
"""

from __future__ import annotations

import ast
import functools
import io
import re
import sys
import tokenize
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
MOST_WORDS = 30

_PAGES = ("README.md", "CONTRIBUTING.md", "SECURITY.md", "docs/**/*.md")
_CONTRACT = "proto/**/*.proto"
_FOLDERS = ("ual_daemon", "clients/python", "tests", "benchmarks", "examples", "tools")
_MODULES = tuple(f"{folder}/**/*.py" for folder in _FOLDERS)
_NOT_OURS = re.compile(r"/v1/.*_pb2|/(?:\.venv|build|dist|node_modules)/")

_FENCE = re.compile(r"^( *)(```+|~~~+)")
_HTML = re.compile(r"<!--.*?-->|</?[a-zA-Z][^<>]*>", re.DOTALL)
_SPAN = re.compile(r"(`+)(?!`).+?(?<!`)\1(?!`)")
_PICTURE = re.compile(r"!\[[^\]]*\]\([^)]*\)")
_LINK = re.compile(r"\[([^\]]*)\](?:\([^)]*\)|\[[^\]]*\])")
_ADDRESS = re.compile(r"https?://\S*[\w/]|<[\w.+-]+@[\w.-]+>")
_ITEM = re.compile(r"\s*(?:[-*+]|(?P<number>\d+)[.)])\s+")
_TABLE = re.compile(r"\s*\|")
_HEADING = re.compile(r"\s*(?:#{1,6}\s|={3,}|-{3,}\s*$|:?-+:?\s*\|)")
_SHORT = re.compile(r"\b(?:e\.g|i\.e|cf|vs|etc|approx|No|Fig|resp|incl)\.(?=\s)")
_END = re.compile(r"(?<=[.!?])[)\]\"'*_’”]*\s+(?=[\"'(*_\[“‘]*[^\sa-z])|(?<=[.!?])[)\]\"'*_]*$")
_SECTION = re.compile(r"\s*(?:Args|Raises|Returns|Yields|Attributes|Note|Example|Examples):\s*$")
_ARGUMENT = re.compile(r"\s*\*{0,2}[\w.,`* ]{1,60}: ")
_WORD = re.compile(r"\w")
_BLOCKS = ("body", "orelse", "handlers", "finalbody", "cases")
"""Attributes with the statements within a statement."""
_NAMED = (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
COMMENTS = re.compile(r"(?:^[ \t]*#.*\n?)+|#.*", re.MULTILINE)
"""Comments, each with the lines that continue it, and what looks like one."""
_COMMENTED_OUT = re.compile(r"\s*(?:noqa|type: ignore|fmt: |mypy: |!)")


class Sentence(NamedTuple):
    """A sentence, and the line in which its paragraph begins."""

    line: int
    text: str

    @property
    def words_count(self) -> int:
        """Number of its words."""
        return sum(bool(_WORD.search(word)) for word in self.text.split())


def of_page(text: str) -> list[Sentence]:
    """Returns the sentences of a page in Markdown."""
    return _sentences(_without_code(text.splitlines()))


def of_module(text: str) -> list[Sentence]:
    """Returns the sentences of a module's comments and docstrings."""
    return sorted([*of_docstrings(text), *_sentences(_comment_rows(text))])


def of_contract(text: str) -> list[Sentence]:
    """Returns the sentences of the comments of a ``.proto`` file."""
    return _sentences(_contract_rows(text))


def _contract_rows(text: str) -> Lines:
    """Yields the comments, but no tables (indented); one that stands behind code is a paragraph of its own."""
    for number, line in enumerate(text.splitlines(), 1):
        code, _, said = line.partition("//")
        if code.strip():
            yield number, ""
        yield number, "" if said.startswith("   ") else said
        if code.strip():
            yield number, ""


def of_docstrings(text: str) -> list[Sentence]:
    """Returns the sentences of a module's docstrings."""
    return [each for line, said in outline(text).docstrings for each in _sentences(_docstring_rows(line, said))]


def of_file(path: Path) -> list[Sentence]:
    """Returns the sentences of a file, those of short comments left out: to find comments takes most of the time."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        return of_page(text)
    if path.suffix == ".proto":
        return of_contract(text)
    return of_module(text) if _has_long_comment(text) else of_docstrings(text)


def _has_long_comment(text: str) -> bool:
    """Returns whether a comment, or what looks like one, is long enough for a long sentence."""
    return any(len(block[0].split()) > MOST_WORDS for block in COMMENTS.finditer(text))


@functools.cache
def long_ones(path: Path) -> list[Sentence]:
    """Returns the sentences of a file that are too long."""
    return [each for each in of_file(path) if each.words_count > MOST_WORDS]


def files() -> list[Path]:
    """Returns all files whose sentences are counted."""
    found = {path for pattern in (*_PAGES, *_MODULES, _CONTRACT) for path in ROOT.glob(pattern)}
    return sorted(path for path in found if not _NOT_OURS.search(f"/{path.relative_to(ROOT).as_posix()}"))


Lines = Iterator[tuple[int, str]]
"""Numbered lines; an empty one ends a paragraph."""


def _without_code(lines: list[str]) -> Lines:
    fence, before = "", ""
    for number, line in enumerate(lines, 1):
        opened = _FENCE.match(line)
        if fence or opened:
            if opened and not fence:
                fence = opened[2]
            elif line.strip() == fence:
                fence = ""
            yield number, ""
        elif line.startswith(("    ", "\t")) and not before.strip() and not _ITEM.match(line):
            yield number, ""  # a block of code: what follows it in the block is code, too
            continue
        else:
            yield number, line
        before = line


class Outline(NamedTuple):
    """Docstrings of a module and its parts, and the names of its classes and functions, each with its line."""

    docstrings: list[tuple[int, str]]
    names: list[tuple[int, str]]


@functools.cache
def outline(text: str) -> Outline:
    """Returns the outline of a module. It is cached: to parse takes most of the time of a check."""
    found = list(statements(ast.parse(text)))
    names = [(each.lineno, each.name) for each in found if isinstance(each, _NAMED)]
    return Outline(list(docstrings(found)), names)


def statements(node: ast.AST) -> Iterator[ast.stmt]:
    """Yields all statements within one: a fifth of the nodes that `ast.walk` finds."""
    for part in _BLOCKS:
        for each in getattr(node, part, ()):
            if isinstance(each, ast.stmt):
                yield each
            yield from statements(each)


def docstrings(found: Iterable[ast.stmt]) -> Iterator[tuple[int, str]]:
    """Yields the docstrings among statements: of modules, classes, functions and attributes."""
    for each in found:
        if isinstance(each, ast.Expr) and isinstance(each.value, ast.Constant) and isinstance(each.value.value, str):
            yield each.lineno, each.value.value


def _docstring_rows(first: int, text: str) -> Lines:
    """Yields the lines, with the entries of sections (``Args:``) as paragraphs of their own."""
    is_section = is_code = False
    for number, line in enumerate(text.splitlines(), first):
        if is_code and (not line.strip() or line.startswith(" " * 8)):
            yield number, ""
            continue
        is_code = False
        if _SECTION.match(line):
            is_section = True
            yield number, ""
        elif is_section and _ARGUMENT.match(line):
            yield number, ""
            yield number, _ARGUMENT.sub("", line, count=1)
        else:
            yield number, line.replace("::", ".") if line.rstrip().endswith("::") else line
            is_code = line.rstrip().endswith("::")


def _comment_rows(text: str) -> Lines:
    """Yields the comments; one that stands behind code, or after a gap, is a paragraph of its own."""
    last = 0
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type != tokenize.COMMENT:
            continue
        line, said = token.start[0], token.string.lstrip("#").strip()
        is_whole_line = token.line.lstrip().startswith("#")
        if line != last + 1 or not is_whole_line:
            yield line, ""
        yield line, "" if _COMMENTED_OUT.match(said) else said
        if not is_whole_line:
            yield line, ""
        last = line if is_whole_line else 0


def _sentences(lines: Lines) -> list[Sentence]:
    return [Sentence(line, said) for line, text in _paragraphs(lines) for said in _split(text)]


def _paragraphs(lines: Lines) -> Iterator[tuple[int, str]]:
    begin, words, is_list = 0, list[str](), False
    for number, quoted in lines:
        line = re.sub(r"^\s*>\s?", "", quoted)
        is_apart = not line.strip() or bool(_TABLE.match(line) or _HEADING.match(line))
        item = _ITEM.match(line)
        # As in Markdown, a text is not interrupted by a line that happens to begin with a number.
        is_item = bool(item and (item["number"] in (None, "1") or is_list or not words))
        if words and (is_apart or is_item):
            yield begin, " ".join(words)
            words = []
        is_list = is_item or (is_list and not is_apart)
        if not is_apart:
            begin = begin if words else number
            words.append((_ITEM.sub("", line, count=1) if is_item else line).strip())
    if words:
        yield begin, " ".join(words)


def _split(text: str) -> list[str]:
    text = _HTML.sub(" ", _ADDRESS.sub("address", _SPAN.sub("Code", text)))
    text = _SHORT.sub(lambda match: match[0].replace(".", ""), _LINK.sub(r"\1", _PICTURE.sub("", text)))
    return [part.strip() for part in _END.split(text) if _WORD.search(part)]


def main() -> None:
    """Prints the long sentences."""
    for path in [Path(name).resolve() for name in sys.argv[1:]] or files():
        for each in long_ones(path):
            print(f"{path.relative_to(ROOT)}:{each.line}: {each.words_count} words: {each.text}")


if __name__ == "__main__":
    main()
