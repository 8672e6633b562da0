"""Text of a file's bytes, as Windows, Mission Planner and old programs write it, too."""

from __future__ import annotations

import codecs
import io
import re
from collections.abc import Iterable
from pathlib import Path

_MARKS = (
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
"""The longer marks first: that of UTF-32 begins with that of UTF-16."""
_DECLARED = re.compile(rb"""<\?xml[^>]{0,100}encoding=["']([A-Za-z0-9._-]{1,40})["']""")
_ONE_BYTE = re.compile(r"(iso-?8859|windows-?125|cp125|latin|koi8)[-_]?[0-9a-z]{0,4}", re.IGNORECASE)
_LONGEST_TEXT_CHARACTERS = 500
"""Of a text that another program says."""
_NO_TEXT = "is not a text file"
_NOT_IN_TEXT = re.compile(r"[\x00-\x08\x0b\x0e-\x19\x1b-\x1f]")
"""Control characters that no text has; \\x1a ends text files of DOS."""


def read_text(path: Path, most_bytes: int) -> str:
    """Returns the text of a file; see `decoded`.

    Raises:
        OSError: It cannot be read.
        ValueError: It is too large, or is no text.

    """
    with path.open("rb") as file:
        data = file.read(most_bytes + 1)
    if len(data) > most_bytes:
        raise ValueError(f"is too large: it may have at most {most_bytes} bytes")
    return decoded(data)


def decoded(data: bytes) -> str:
    """Returns the text: by its byte-order mark, as UTF-8 or UTF-16, as its XML declaration says, else as Latin-1.

    Numbers are ASCII in each of them: where the encoding is guessed, only names and comments can differ. Raises
    `ValueError`.
    """
    try:
        text = data.decode(_encoding(data))
    except UnicodeDecodeError:
        raise ValueError(_NO_TEXT) from None
    if _NOT_IN_TEXT.search(text):
        raise ValueError(_NO_TEXT)
    return text.removesuffix("\x1a")


def printable(text: str) -> str:
    """Returns a text without what would act on a terminal, cut to a length that fits a table."""
    if len(text) <= _LONGEST_TEXT_CHARACTERS and text.isprintable():
        return text
    return "".join(each if each.isprintable() else "?" for each in text[:_LONGEST_TEXT_CHARACTERS])


def sendable(text: str) -> str:
    """Returns text that protobuf takes: what is no UTF-8, as in the name of a file, is replaced."""
    return text.encode(errors="replace").decode()


def sure_encoding(data: bytes) -> str:
    """Returns the encoding that a byte-order mark or the zeros of UTF-16 show, else UTF-8."""
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            return encoding
    if data[1:2] == b"\0":
        return "utf-16-le"
    return "utf-16-be" if data[:1] == b"\0" else "utf-8"


def _encoding(data: bytes) -> str:
    encoding = sure_encoding(data)
    if encoding != "utf-8":
        return encoding
    try:
        data.decode()
    except UnicodeDecodeError:
        return _declared(data)
    return encoding


def _declared(data: bytes) -> str:
    """Returns the encoding that an XML declaration names, if each byte is a character in it; else Latin-1."""
    found = _DECLARED.match(data.lstrip()[:200])
    name = "" if found is None else found[1].decode()
    try:
        return codecs.lookup(name).name if _ONE_BYTE.fullmatch(name) else "latin-1"
    except LookupError:
        return "latin-1"


def rows_of(text: str) -> Iterable[str]:
    """Yields the lines, whatever system wrote them. (`str.splitlines` also splits at characters of other encodings.)"""
    return io.StringIO(text, newline=None)
