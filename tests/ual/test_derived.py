"""Output of `make clients`: it is committed, and holds for `ual.interface`."""

from __future__ import annotations

import inspect
import pydoc
from pathlib import Path
from typing import Any

import pytest

import ual
import ual.interface
from tools import clients
from tools.contract.compiled import compiled
from tools.contract.parts import parts
from ual import _client, _derived_parts
from ual.aio import _derived_parts as aio_parts

ROOT = Path(__file__).parents[2]
BY_HAND = {
    "ns",
    "close",
    "subscribe",
    "lease",
    "extension",
    "task",
    "dry_run",
    "simulation",
    *(each.module for each in parts(compiled()) if not each.bound),
}
"""Members that are more than one call, or another thing for asyncio."""


def names_of(owner: type) -> set[str]:
    return {name for name in vars(owner) if not name.startswith("_")}


def test_the_committed_members_are_those_of_the_calls() -> None:
    outdated = [
        path.relative_to(ROOT).as_posix()
        for path, source in clients.sources().items()
        if path.read_text(encoding="utf-8") != source
    ]
    assert outdated == [], "out of date: make clients"


def test_a_member_of_the_interface_is_one_call_or_written_by_hand() -> None:
    """So that a member that is new in the interface is not forgotten in the contract."""
    abstract = {name for name in names_of(ual.interface.Uav) if name in ual.interface.Uav.__abstractmethods__}
    one_call = set(clients.OF_UAV)
    assert abstract == one_call | BY_HAND
    assert not one_call & BY_HAND
    assert names_of(ual.interface.Simulation) == set(clients.OF_SIMULATION)


@pytest.mark.parametrize("owner", sorted(each.name for each in parts(compiled())))
def test_both_clients_have_the_members_of_each_service_next_to_flying(owner: str) -> None:
    interface, sync, aio = (getattr(module, owner) for module in (ual.interface, _derived_parts, aio_parts))
    by_hand = {"stream"} if owner == "Corrections" else set()
    assert names_of(interface) == names_of(sync) | by_hand == names_of(aio) | by_hand
    for name in names_of(interface) - by_hand:
        expected = inspect.signature(getattr(interface, name))
        assert inspect.signature(getattr(sync, name)) == expected
        returned = expected.return_annotation
        is_stream = returned.startswith("Iterator[")
        of_aio = expected.replace(return_annotation=f"Async{returned}") if is_stream else expected
        assert inspect.signature(getattr(aio, name)) == of_aio
        assert inspect.iscoroutinefunction(getattr(aio, name)) is not is_stream


@pytest.mark.parametrize("name", sorted(clients.MEMBERS))
def test_both_clients_have_the_signature_of_the_interface(name: str) -> None:
    is_simulation = name in clients.OF_SIMULATION
    interface: Any = ual.interface.Simulation if is_simulation else ual.interface.Uav
    client: Any = _client.Simulation if is_simulation else ual.Uav
    aio: Any = ual.aio.Simulation if is_simulation else ual.aio.Uav
    expected = inspect.signature(getattr(interface, name))
    assert inspect.signature(getattr(client, name)) == expected
    assert inspect.signature(getattr(aio, name)) == expected
    assert inspect.iscoroutinefunction(getattr(aio, name))


def test_help_shows_the_manual_of_a_member() -> None:
    helped = pydoc.plain(pydoc.render_doc(ual.Uav.transform))
    assert "transform(self, target_frame_id: 'str' = '', source_frame_id: 'str' = '') -> 'Transform'" in helped
    assert "source_frame_id: Default ``<ns>/base_link``, the body." in helped
    helped = pydoc.plain(pydoc.render_doc(ual.aio.Uav.set_velocity))
    assert "async set_velocity(self, velocity: 'TwistStamped | Twist') -> 'None'" in helped
    assert "Beyond the limits of the UAV it is scaled down" in helped
    assert "time.sleep" not in helped  # an example that blocks
