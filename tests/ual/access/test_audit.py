"""The chain of an audit: whatever is done to its lines is found."""

from __future__ import annotations

import contextlib
import hashlib
import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from ual.access import audit
from ual.access.audit import BrokenChainError
from ual_tools.main import cli


def chained(entries: list[dict[str, Any]]) -> list[bytes]:
    lines, head = [], audit.START
    for entry in entries:
        text, head = audit.encoded_entry(entry, head)
        lines.append(text)
    return lines


ENTRIES = [{"event": "ended", "method": "/ual.v1.UalService/Land", "id": number} for number in range(6)]


def test_a_whole_chain_is_whole() -> None:
    lines = chained(ENTRIES)
    found = audit.verify(lines)
    assert (found.lines_count, found.torn_count) == (6, 0)
    assert found.head == audit.hash_of(lines[-1])
    assert [json.loads(line)["id"] for line in lines] == list(range(6))


@given(st.integers(0, 5), st.data())
def test_a_changed_row_is_found(number: int, data: st.DataObject) -> None:
    lines = chained(ENTRIES)
    place = data.draw(st.integers(0, len(lines[number]) - 1))
    other = data.draw(st.integers(0, 255).filter(lambda byte: byte not in (lines[number][place], 10)))
    lines[number] = lines[number][:place] + bytes((other,)) + lines[number][place + 1 :]
    if number == 5:  # a last line that is no line is one that a killed daemon has left
        with contextlib.suppress(BrokenChainError):
            assert audit.verify(lines).torn_count == 1
        return
    with pytest.raises(BrokenChainError):
        audit.verify(lines)


@given(st.integers(0, 4))
def test_a_removed_row_is_found(number: int) -> None:
    lines = chained(ENTRIES)
    del lines[number]
    with pytest.raises(BrokenChainError, match=f"line {number + 1} was changed, or lines before it were removed"):
        audit.verify(lines)


@given(st.permutations(range(6)).filter(lambda order: list(order) != list(range(6))))
def test_swapped_rows_are_found(order: list[int]) -> None:
    lines = chained(ENTRIES)
    with pytest.raises(BrokenChainError):
        audit.verify([lines[number] for number in order])


@given(st.integers(0, 5), st.integers(0, 6))
def test_a_row_that_is_put_in_again_is_found(number: int, place: int) -> None:
    lines = chained(ENTRIES)
    lines.insert(place, lines[number])
    with pytest.raises(BrokenChainError):
        audit.verify(lines)


def test_an_incomplete_row_is_allowed_where_the_next_daemon_has_observed_it() -> None:
    lines = chained(ENTRIES[:2])
    torn, head = lines[1][:30], audit.hash_of(lines[0])
    assert head is not None
    opened, _ = audit.encoded_entry({"event": audit.OPENED, audit.TORN: hashlib.sha256(torn).hexdigest()}, head)
    assert audit.verify([lines[0], torn, opened]).torn_count == 1
    with pytest.raises(BrokenChainError, match="line 2 is no line"):
        audit.verify([lines[0], torn + b"x", opened])
    with pytest.raises(BrokenChainError, match="line 2 is no line"):
        audit.verify([lines[0], torn, torn, opened])
    without, _ = audit.encoded_entry({"event": audit.OPENED}, head)
    with pytest.raises(BrokenChainError, match="line 2 is no line"):
        audit.verify([lines[0], torn, without])


def test_the_command_says_whether_it_is_whole(tmp_path: Path) -> None:
    file, lines = tmp_path / "audit.jsonl", chained(ENTRIES)
    file.write_bytes(b"\n".join(lines) + b"\n")
    head = str(audit.hash_of(lines[-1]))
    result = CliRunner().invoke(cli, ["audit", "verify", str(file), "--head", head])
    assert (result.exit_code, result.output) == (0, f"whole: 6 lines; the last hash is {head}\n")
    file.write_bytes(b"\n".join(lines[:-1]) + b"\n")
    assert CliRunner().invoke(cli, ["audit", "verify", str(file)]).exit_code == 0  # nothing tells of it but the hash
    result = CliRunner().invoke(cli, ["audit", "verify", str(file), "--head", head])
    assert result.exit_code == 1
    assert "its end is missing" in result.output
    file.write_bytes(b"\n".join(lines[1:]) + b"\n")
    result = CliRunner().invoke(cli, ["audit", "verify", str(file)])
    assert result.exit_code == 1
    assert "line 1 was changed" in result.output


LINES = chained(ENTRIES)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "it has no whole line of an audit"),
        (b"my-computer\n", "it has no whole line of an audit"),
        (b'{"event":"opened","ti', "it has no whole line of an audit"),
        (LINES[0] + b"\nmy-computer", "line 2 is no line of an audit"),
        (LINES[0] + b"\n" + LINES[1][:30] + b"\n", "line 2 is no line of an audit"),
        (LINES[0] + b"\n" + LINES[1].replace(b"ended", b"ENDED") + b"\n", "line 2 was changed"),
        (LINES[0] + b'\ntorn\n{"event":"opened",,"hash":"' + b"0" * 64 + b'"}\n', "line 2 is no line of an audit"),
        (LINES[0] + b"\n\n", "line 2 is no line of an audit"),
    ],
)
def test_what_is_no_audit_is_refused(tmp_path: Path, content: bytes, message: str) -> None:
    file = tmp_path / "file"
    file.write_bytes(content)
    result = CliRunner().invoke(cli, ["audit", "verify", str(file)])
    assert (result.exit_code, result.stdout) == (1, "")
    assert f"{file}: {message}" in result.stderr


def test_a_last_row_that_a_killed_daemon_has_left_is_counted(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(LINES[0] + b"\n" + LINES[1][:30])
    result = CliRunner().invoke(cli, ["audit", "verify", str(file)])
    assert result.exit_code == 0
    assert result.output.startswith("whole: 2 lines, 1 of them incomplete (its daemon ended amid it); the last hash is")
