"""Reports about the languages of `clients/`, whether the machine has them or not."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.clients import toolchains
from tests.clients.toolchains import CLIENTS, LANGUAGES


def test_a_missing_toolchain_is_named_with_the_path_to_get_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(toolchains, "BUF", tmp_path)
    for each in LANGUAGES:
        assert f"{each.name} does not fly here: no {', '.join(each.needed)}. Get it: {each.get}" == each.missing()


def test_the_commands_are_those_of_the_readmes() -> None:
    for each in LANGUAGES:
        readme = (each.path / "README.md").read_text(encoding="utf-8")
        for command in (*each.build, each.mission):
            assert " ".join(command) in readme


def test_each_folder_is_executed() -> None:
    folders = {path.name for path in CLIENTS.iterdir() if (path / "README.md").exists()}
    assert folders == {each.folder for each in LANGUAGES} | {"python"}
