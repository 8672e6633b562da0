"""The places that the campaign's mutants change are there: a defect that changes nothing would be found by nobody."""

from __future__ import annotations

import importlib.util
import subprocess
import sys

from tests.campaign.mutants import MUTANTS

CHANGE = "import sys; from tests.campaign.mutants import MUTANTS; [MUTANTS[name]() for name in sys.argv[1:]]"


def test_what_each_mutant_changes_is_there() -> None:
    is_watched = importlib.util.find_spec("ual_daemon.flight.policy.following") is not None
    names = [name for name in MUTANTS if is_watched or name != "unwatched"]
    assert len(names) >= 12
    subprocess.run([sys.executable, "-c", CHANGE, *names], check=True)
