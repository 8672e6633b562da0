"""The network that a client finds by its name: from its argument, and from the environment."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

import ual
from tests.ports import free_port
from tests.ual.network.samples import report, uav
from tests.ual.network.zenoh_net import ZenohNet
from tests.waiting import until
from ual.errors import DaemonUnreachableError, InvalidArgumentError
from ual.network import NetworkSettings, membership
from ual.network.publishing import Publication
from ual.network.values import Report

pytest.importorskip("zenoh", reason="ZENOH IS MISSING, the network is NOT TESTED: pip install 'ual-client[network]'")

HERE, THERE = "127.0.0.1:50051", "10.0.0.1:50051"


@pytest.fixture(autouse=True)
def nothing_from_outside(monkeypatch: pytest.MonkeyPatch, runtime_dir: Path) -> None:
    del runtime_dir
    for name in ("UAL_NS", "UAL_ADDRESS", "UAL_TLS_CA", "UAL_NETWORK"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def config(tmp_path: Path, net: ZenohNet) -> Path:
    """The file of a network with a router."""
    file = tmp_path / "network.yaml"
    file.write_text(f"site: {net.site}\nconnect: [{net.endpoint}]\n")
    net.router()
    return file


@pytest.fixture
def telling(net: ZenohNet) -> Iterator[Callable[..., None]]:
    """Lets daemons tell again and again until the test ends."""
    told: list[tuple[Publication, Report]] = []
    end = threading.Event()

    def tell() -> None:
        while not end.wait(0.02):
            for publication, once in tuple(told):
                publication.put(once)

    def begin(name: str, address: str = THERE) -> None:
        told.append((net.publication(name, len(told) + 1), report(uav(name, address=address))))

    with ExitStack() as stack:
        thread = threading.Thread(target=tell)
        thread.start()
        stack.callback(thread.join)
        stack.callback(end.set)
        yield begin


def test_the_environment_names_the_network_for_a_program_too(
    config: Path, telling: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else a program flies the UAV of this name that is on its own computer."""
    telling("uav_2")
    monkeypatch.setenv("UAL_NETWORK", str(config))
    with ual.Uav("uav_2") as client:
        assert client.address == THERE
    with ual.Team(["uav_2"]) as team:
        assert team["uav_2"].address == THERE


@pytest.mark.parametrize("kind", [str, Path, NetworkSettings])
def test_a_network_is_named_as_by_the_command(
    kind: Callable[..., object], config: Path, net: ZenohNet, telling: Callable[..., None]
) -> None:
    telling("uav_2")
    network = net.settings if kind is NetworkSettings else kind(config)
    with ual.Uav("uav_2", network=network) as client:  # type: ignore[arg-type]
        assert client.address == THERE


def test_with_asyncio_the_first_call_waits_for_the_network(config: Path, telling: Callable[..., None]) -> None:
    telling("uav_2")

    async def address() -> str:
        async with ual.aio.Uav("uav_2", network=config) as client, client._connection.calling() as route:
            return route.address

    assert asyncio.run(address()) == THERE


def test_clients_of_one_network_join_it_once_and_the_last_one_leaves_it(
    config: Path, telling: Callable[..., None]
) -> None:
    telling("uav_1")
    telling("uav_2", "10.0.0.2:50051")
    first, second = (ual.Uav(name, network=config) for name in ("uav_1", "uav_2"))
    assert (first.address, second.address) == (THERE, "10.0.0.2:50051")
    assert membership.joined() == 1
    first.close()
    assert (membership.joined(), second.address) == (1, "10.0.0.2:50051")
    second.close()
    assert membership.joined() == 0


def test_the_only_one_of_the_network_needs_no_name(config: Path, telling: Callable[..., None]) -> None:
    telling("uav_2")
    with ual.Uav(network=config) as client:
        assert (client.address, client.ns) == (THERE, "uav_2")
    telling("uav_1")
    with ual.Uav(network=config) as client:
        until(lambda: _refusal(client) == "ns: 2 UAVs are on the network: choose one by its name (ns, --ns)")


def _refusal(client: ual.Uav) -> str:
    try:
        return client.address
    except InvalidArgumentError as error:
        return str(error)


def test_a_router_that_comes_later_is_found(tmp_path: Path, net: ZenohNet, telling: Callable[..., None]) -> None:
    file = tmp_path / "network.yaml"
    file.write_text(f"site: {net.site}\nconnect: [{net.endpoint}]\n")
    with ual.Uav("uav_2", network=file) as client:
        with pytest.raises(DaemonUnreachableError, match="no router of the network answers"):
            client.address  # noqa: B018
        net.router()
        telling("uav_2")
        until(lambda: _found(client) == THERE)


def _found(client: ual.Uav) -> str:
    try:
        return client.address
    except DaemonUnreachableError:
        return ""


def test_a_network_that_cannot_be_read_is_reported_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("UAL_NETWORK", str(tmp_path / "none.yaml"))
    for make in (ual.Uav, ual.aio.Uav):
        with pytest.raises(InvalidArgumentError, match=r"none\.yaml: cannot be read: No such file"):
            make("uav_1")


def test_what_a_program_says_goes_before_the_environment(
    config: Path, telling: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    telling("uav_1")
    monkeypatch.setenv("UAL_NETWORK", str(config))
    with ual.Uav("uav_1", address=HERE) as client:
        assert client.address == HERE
    with ual.Uav("uav_1", network="") as client:  # this computer
        assert client.address == HERE
    monkeypatch.setenv("UAL_NETWORK", "loopback")
    monkeypatch.setenv("UAL_ADDRESS", HERE)
    with ual.Uav("uav_1", network=config) as client:
        assert client.address == THERE


def test_two_variables_that_contradict_each_other_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("UAL_NETWORK", "loopback")
    monkeypatch.setenv("UAL_ADDRESS", f"127.0.0.1:{free_port()}")
    with pytest.raises(InvalidArgumentError, match="UAL_ADDRESS and UAL_NETWORK both say where the UAV is: unset one"):
        ual.Uav("uav_1")
