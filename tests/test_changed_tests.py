"""The tests that can see a change: `make test-changed`."""

from __future__ import annotations

import grimp
import pytest

from tools.changed_tests import affected_tests, distances, module_of


@pytest.fixture
def graph() -> grimp.ImportGraph:
    """`test_near` imports a module, `test_far` one that imports it."""
    graph = grimp.ImportGraph()
    for importer, imported in (
        ("tests.test_near", "ual_daemon.geodesy"),
        ("ual_daemon.planner", "ual_daemon.geodesy"),
        ("tests.test_far", "ual_daemon.planner"),
        ("tests.test_other", "ual_daemon.logs"),
    ):
        graph.add_import(importer=importer, imported=imported)
    return graph


def test_the_nearest_tests_come_first_and_the_others_not_at_all(graph: grimp.ImportGraph) -> None:
    assert affected_tests(graph, ["ual_daemon/geodesy.py"], 0) == ["tests/test_near.py", "tests/test_far.py"]
    assert affected_tests(graph, ["ual_daemon/geodesy.py"], 1) == ["tests/test_near.py"]


def test_a_changed_test_is_run_itself(graph: grimp.ImportGraph) -> None:
    assert affected_tests(graph, ["tests/test_other.py"], 1) == ["tests/test_other.py"]


def test_a_file_is_visible_to_the_tests_that_name_it_or_all_of_its_kind(graph: grimp.ImportGraph) -> None:
    assert "tests/test_docs.py" in affected_tests(graph, ["docs/how-to/missions.md"], 2)
    assert affected_tests(graph, ["proto/" + "no_such" + ".unheard"], 2) == []


@pytest.mark.parametrize(
    ("path", "module"),
    [
        ("ual_daemon/flight/state.py", "ual_daemon.flight.state"),
        ("ual_daemon/flight/__init__.py", "ual_daemon.flight"),
        ("clients/python/ual/_client.py", "ual._client"),
        ("clients/ros2/ual_ros2/ual_ros2/node.py", ""),
        ("README.md", ""),
    ],
)
def test_a_path_has_the_name_by_which_python_imports_it(path: str, module: str) -> None:
    assert module_of(path) == module


def test_the_real_graph_leads_from_the_state_to_its_test() -> None:
    found = distances(grimp.build_graph("ual_daemon", "tests", cache_dir=None), ["ual_daemon.flight.state"])
    assert found["tests.ual_daemon.flight.test_state"] == 1
