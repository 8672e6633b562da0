"""Single reader of YAML: the files that it takes, and its refusals with the line."""

from __future__ import annotations

import pytest

from ual.shared import strict_yaml
from ual.shared.strict_yaml import YamlError


def nested(depth: int) -> bytes:
    return b"a: " + b"[" * depth + b"]" * depth


def test_values_are_those_of_yaml_1_2() -> None:
    node = strict_yaml.read(b"a: 1e3\nb: 12:30\nc: on\nd: [0x10, ~, true]\n<<: {e: 010}\n")
    assert strict_yaml.value(node) == {"a": 1000.0, "b": "12:30", "c": "on", "d": [16, None, True], "e": 10.0}


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-32"])
def test_it_is_read_as_windows_writes_it(encoding: str) -> None:
    assert strict_yaml.value(strict_yaml.read("a: 1\r\nb: ü\r\n".encode(encoding))) == {"a": 1, "b": "ü"}


def test_an_empty_text_has_no_value() -> None:
    assert strict_yaml.read(b"# nothing\n") is None
    assert strict_yaml.value(None) is None


@pytest.mark.parametrize(
    ("data", "line", "why"),
    [
        (b"a: 1\nb:\n  c: 1\n  c: 2\n", 4, "b.c: given twice, first in line 3"),
        (b"a: 1\n[b]: 2\n", 2, "a key must be text"),
        (b"a: 1\n2: b\n", 2, "a key must be text"),
        (b"a: 1\nb: &b [*b]\n", 2, "b[0]: the value contains itself"),
        (b"a: 1\nb: \xff\n", 2, "byte 0xff is not UTF-8 text"),
        (b"a: 1\nb: \x07\n", 2, "character 0x0007 is not allowed"),
        (b"a: 1\nb: [\n", 3, "while parsing a flow node"),
        (b"a: 1\nb: !!int x\n", 2, "'x' is not a valid int"),
        (b"a: 1\nb: !!python/name:os.system x\n", 2, "could not determine a constructor"),
        (nested(50), 1, "values are nested too deeply"),
        (nested(50_000), 1, "values are nested too deeply"),
    ],
)
def test_what_is_refused_is_reported_with_its_row(data: bytes, line: int, why: str) -> None:
    with pytest.raises(YamlError) as refused:
        strict_yaml.value(strict_yaml.read(data))
    assert str(refused.value).startswith(why)
    assert refused.value.line == line


def test_what_is_as_deep_as_allowed_is_read() -> None:
    strict_yaml.value(strict_yaml.read(nested(49)))


def test_aliases_count_each_time() -> None:
    lists = "".join(f"b{i}: &b{i} [{', '.join([f'*b{i - 1}'] * 50)}]\n" for i in range(1, 4))
    with pytest.raises(YamlError, match="more than 100000 values"):
        strict_yaml.read(f"b0: &b0 [{', '.join(['1'] * 50)}]\n{lists}".encode())
