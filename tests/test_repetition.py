"""What `make test` leaves out, and that its workers share no flight: rules which fail silently."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests import repetition
from tests.ual.test_conformance import WAYS
from tests.ual_daemon.backends.faults.crafts import CRAFTS
from ual import conformance

ROOT = Path(__file__).parents[1]


def test_the_rules_name_what_there_is() -> None:
    for each in (*repetition.PROGRAMS, *repetition.WHOLE, *repetition.BOTH_ALIKE):
        path, _, test = each.partition("::")
        assert (ROOT / path).exists()
        assert not test or f"def {test}" in (ROOT / path).read_text()
    assert set(repetition.SAME_BACKEND) < set(CRAFTS)
    rooms = {check.run.__module__.rpartition(".")[2] for check in conformance.CHECKS}
    assert rooms > repetition._ABOVE_BACKENDS
    names = {check.name for check in conformance.CHECKS}
    assert names > (repetition._OF_TRAJECTORIES | repetition._OF_THE_WIRE)
    assert set(repetition.WHOLE["tests/ual/test_conformance.py"]) < {str(way.id) for way in WAYS}


@pytest.mark.xdist_group("flight")
def test_a_group_of_tests_keeps_to_one_worker(request: pytest.FixtureRequest) -> None:
    """pytest-xdist groups by the end of the name. With pytest 9.2 it had none, and each worker flew each flight."""
    if not request.config.getoption("loadgroup", default=False):
        pytest.skip("nothing is shared out by groups: -n 2 --dist loadgroup")
    assert request.node.nodeid.endswith("@flight")
