"""The page of Telemetry's fields: the comments of the contract, message by message."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

_CONTRACT = Path(__file__).parents[2] / "proto" / "ual" / "v1" / "ual.proto"
_HEAD = """# Telemetry's fields

<!-- `make pages` writes this page from proto/ual/v1/ual.proto. -->
<!-- search: telemetry fields, telemetry rate, sample, battery, gps info, health -->

A sample of `GetTelemetry`, `StreamTelemetry` and `uav.telemetry()`, from the comments of [the contract](contract.rst).
In Python optional fields are None where they are not set. [How to read telemetry](../how-to/read-telemetry.md).
"""
_MESSAGE = re.compile(r"((?:^//[^\n]*\n)*)^(message|enum) (\w+) \{\n(.*?)^\}", re.MULTILINE | re.DOTALL)
_FIELD = re.compile(r"^(?:((?:optional |repeated )?[\w.]+|map<[\w, ]+>) )?(\w+) = \d+")
_ALSO = ("State", "Health", "Battery", "GpsInfo", "GeoPoint", "Task", "TaskError")


def page() -> str:
    """Returns the page."""
    found = {match[3]: match for match in _MESSAGE.finditer(_CONTRACT.read_text(encoding="utf-8"))}
    return "\n".join([_HEAD, *(_section(found[name]) for name in ("Telemetry", *_ALSO))])


def _section(message: re.Match[str]) -> str:
    about, _, name, body = message.groups()
    lines = "".join(
        f"- `{field}`{f' ({type_})' if type_ else ''}{f': {text}' if text else ''}\n"
        for field, type_, text in _fields(body)
    )
    words = _joined(about.splitlines())
    return f"## {name}\n\n" + (f"{words}\n\n" if words else "") + lines


def _fields(body: str) -> Iterator[tuple[str, str, str]]:
    comment: list[str] = []
    for line in map(str.strip, body.splitlines()):
        if line.startswith("//"):
            comment.append(line)
        elif found := _FIELD.match(line):
            yield found[2], found[1] or "", _joined(comment)
            comment = []
        else:
            comment = []


def _joined(comments: list[str]) -> str:
    text = " ".join(line.removeprefix("//").strip() for line in comments)
    return re.sub(r"(`[^`]*`)|([<*_])", lambda found: found[1] or f"\\{found[2]}", text)
