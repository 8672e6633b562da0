"""Imports of the packages from each other, functions and type checks included: no circles, and nothing private."""

from __future__ import annotations

import re
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("ual", "ual_tools", "ual_daemon")


@pytest.fixture(scope="module")
def graph() -> grimp.ImportGraph:
    return grimp.build_graph(*PACKAGES, cache_dir=None)


@pytest.mark.parametrize("package", PACKAGES)
def test_no_modules_import_each_other_in_a_circle(graph: grimp.ImportGraph, package: str) -> None:
    modules = [module for module in graph.modules if module.partition(".")[0] == package]
    assert len(modules) > 50
    assert circle({module: graph.find_modules_directly_imported_by(module) for module in modules}) == []


def circle(imported: dict[str, set[str]]) -> list[str]:
    """The modules of a circle, each of which imports the next; empty where there is none."""
    try:
        TopologicalSorter(imported).prepare()
    except CycleError as error:
        return [*reversed(error.args[1])]
    return []


def test_a_circle_is_found() -> None:
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"b"}}) in (["b", "c", "b"], ["c", "b", "c"])
    assert circle({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []


def test_the_contract_names_all_that_is_private_in_the_client(graph: grimp.ImportGraph) -> None:
    """So `lint-imports` refuses each import of it by the daemon and the tools."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    named = re.search(
        r'name = "What is private in the client stays there".*?protected_modules = \[(.*?)\]', text, re.DOTALL
    )
    assert named is not None
    private = {found[0] for module in graph.modules if (found := re.match(r"ual\..*?\b_\w+", module))}
    assert set(re.findall(r'"([^"]+)"', named[1])) == private


@pytest.mark.parametrize("importer", ["ual_daemon", "ual_tools"])
def test_nothing_private_of_the_client_is_imported(graph: grimp.ImportGraph, importer: str) -> None:
    modules = [module for module in graph.modules if module.partition(".")[0] == importer]
    imports = {(module, found) for module in modules for found in graph.find_modules_directly_imported_by(module)}
    assert [pair for pair in imports if re.match(r"ual\..*?\b_", pair[1])] == []
