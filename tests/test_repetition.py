"""The rules for what `make test` leaves out speak of what there is: else they would leave out nothing, or all."""

from __future__ import annotations

from pathlib import Path

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
