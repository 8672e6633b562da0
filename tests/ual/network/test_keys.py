"""The keys: what they are, and for which UAVs a publisher may speak."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.ual.network.samples import source
from ual.network import keys

counted = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,20}", fullmatch=True)


def test_the_keys_of_a_process() -> None:
    assert source().alive == "ual/farm/uav_1/00000000000000aa/alive"
    assert source().telemetry == "ual/farm/uav_1/00000000000000aa/telemetry"
    assert keys.all_alive("farm") == "ual/farm/*/*/alive"
    assert keys.all_of("farm", "uav_1-200") == "ual/farm/uav_1-200/**"


@pytest.mark.parametrize("publisher", ["uav_1", "uav_1-200"])
def test_a_key_says_which_process_it_belongs_to(publisher: str) -> None:
    one = source(publisher)
    assert keys.source_of(one.alive) == keys.source_of(one.telemetry) == one


@pytest.mark.parametrize(
    "key",
    [
        "",
        "ual/farm/uav_1/00000000000000aa",
        "ual/farm/uav_1/00000000000000AA/alive",
        "ual/farm/uav_1/00000000000000aa/alive/more",
        "ual/farm/uav 1/00000000000000aa/alive",
        "ual/farm/uav_1-x/00000000000000aa/alive",
        "ual/farm/uav_1/00000000000000aa/command",
        "other/farm/uav_1/00000000000000aa/alive",
    ],
)
def test_any_other_key_belongs_to_none(key: str) -> None:
    assert keys.source_of(key) is None


def test_a_fleet_speaks_for_its_uavs_only() -> None:
    assert keys.publisher(["uav_7"]) == "uav_7"
    assert keys.publisher([f"uav_{number}" for number in range(3, 12)]) == "uav_3-11"
    assert [number for number in range(20) if keys.speaks_for("uav_3-11", f"uav_{number}")] == [*range(3, 12)]
    assert keys.speaks_for("uav_7", "uav_7")
    for other in ("uav_70", "uav", "uav_07", "xuav_7", "uav_7-9"):
        assert not keys.speaks_for("uav_7", other), other
    for other in ("uav_03", "boat_5", "uav_3-11", "uav", "uav_", "uav_5 "):
        assert not keys.speaks_for("uav_3-11", other), other


@given(counted, st.integers(0, 10**6), st.integers(1, 500))
def test_a_fleets_publisher_speaks_for_each_of_it_and_for_none_next_to(base: str, first: int, count: int) -> None:
    names = [f"{base}_{first + i}" for i in range(count)]
    publisher = keys.publisher(names)
    assert keys.is_publisher(publisher)
    assert all(keys.speaks_for(publisher, name) for name in names)
    assert not keys.speaks_for(publisher, f"{base}_{first + count}")
    assert not (first and keys.speaks_for(publisher, f"{base}_{first - 1}"))
