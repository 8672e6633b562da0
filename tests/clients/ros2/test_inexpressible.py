"""Values that ROS cannot express: the list that the flights use, and that of the documentation."""

from __future__ import annotations

import re

import pytest

from tests.clients.ros2.environments import ROOT
from ual import conformance

SECTION = re.compile(r"### What they cannot express\n(.*?)\n## ", re.DOTALL)


@pytest.fixture
def reasons(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    monkeypatch.syspath_prepend(str(ROOT / "clients" / "ros2" / "ual_ros2" / "test"))
    from inexpressible import INEXPRESSIBLE

    return {name: listed.why for name, listed in INEXPRESSIBLE.items()}


def test_each_name_is_that_of_a_check(reasons: dict[str, str]) -> None:
    assert reasons.keys() <= {check.name for check in conformance.CHECKS}


def test_the_documentation_lists_the_same_checks_and_reasons(reasons: dict[str, str]) -> None:
    section = SECTION.search((ROOT / "docs" / "reference" / "clients" / "ros2.md").read_text())
    assert section is not None
    rows = [line.strip("| ").split(" | ") for line in section[1].splitlines()[:-1] if " | `" in line]
    assert {name: why for why, names in rows for name in re.findall(r"`(\w+)`", names)} == reasons
