"""Presence and telemetry over real Zenoh, with routers on loopback."""

from __future__ import annotations

import asyncio
import socket
import subprocess
import sys
import threading
from collections.abc import Callable

import pytest

import ual
from tests.ports import free_port
from tests.ual.network.samples import report, uav
from tests.ual.network.zenoh_net import ZenohNet, saying
from tests.waiting import LIMIT_S, until
from ual.errors import DaemonUnreachableError, InvalidArgumentError
from ual.network import Network, NetworkSettings, Scouting, discover, listening

pytest.importorskip("zenoh", reason="ZENOH IS MISSING, the network is NOT TESTED: pip install 'ual-client[network]'")


def names(network: Network) -> list[str]:
    return [each.ns for each in network.uavs() if each.gone_s is None]


def test_a_uav_appears_is_received_and_vanishes(net: ZenohNet) -> None:
    net.router()
    network, told = net.network(), net.publication()
    until(lambda: names(network), between=saying(told, report()))
    [found] = network.uavs()
    assert found == network.find("uav_1")
    assert (found.site, found.addresses, found.telemetry.battery) == (
        net.site,
        uav().addresses,
        uav().telemetry.battery,
    )
    told.close()
    until(lambda: network.find("uav_1").gone_s is not None)
    assert network.problems == {}


def test_who_listens_later_hears_who_was_there_before(net: ZenohNet) -> None:
    net.router()
    told = net.publication()
    network = net.network()
    until(lambda: not network._is_complete)  # the token is known, and no report has come
    say = saying(told, report())
    until(lambda: network._is_complete, between=say)  # one that is told before it is subscribed to is lost
    assert network.wait_until_complete(LIMIT_S)
    assert names(network) == ["uav_1"]


@pytest.mark.parametrize("is_asyncio", [False, True])
def test_a_client_of_a_uav_can_be_made_at_once(
    net: ZenohNet, monkeypatch: pytest.MonkeyPatch, is_asyncio: bool
) -> None:
    """Else `ual.Uav("uav_1", network=Network())` would fail, unless the report came first. With asyncio it is the first
    call that waits.
    """
    monkeypatch.setattr(listening, "_JOIN_S", LIMIT_S)
    net.router()
    told = net.publication()
    network = net.network()

    async def address() -> str:
        async with ual.aio.Uav("uav_1", network=network) as client:  # it is made while nothing was said
            saying_later.start()
            async with client._connection.calling() as route:
                return route.address

    saying_later = threading.Thread(target=lambda: until(lambda: names(network), between=saying(told, report())))
    if is_asyncio:
        found = asyncio.run(address())
    else:
        saying_later.start()
        with ual.Uav("uav_1", network=network) as client:
            found = client.address
    saying_later.join()
    assert found == uav().addresses[0]


def test_two_routers_are_one_network(net: ZenohNet) -> None:
    other = f"tcp/127.0.0.1:{free_port()}"
    net.router()
    net.router(net.endpoint, endpoint=other)
    network = net.network(NetworkSettings(site=net.site, connect=(other,)))
    told = net.publication()
    until(lambda: names(network) == ["uav_1"], between=saying(told, report()))


@pytest.mark.parametrize("is_silent", [False, True], ids=["refuses", "is silent"])
def test_what_starts_uses_the_first_router_that_answers(net: ZenohNet, *, is_silent: bool) -> None:
    """A router that was killed refuses; one that is stopped takes the connection and says nothing."""
    with socket.socket() as first:
        first.bind(("127.0.0.1", 0))
        if is_silent:
            first.listen()
        port = first.getsockname()[1]
        both = NetworkSettings(site=net.site, connect=(f"tcp/127.0.0.1:{port}", net.endpoint))
        net.router()
        network, told = net.network(both), net.publication(settings=both)
        until(lambda: names(network) == ["uav_1"], between=saying(told, report()))


def test_other_sites_are_not_received(net: ZenohNet) -> None:
    net.router()
    network = net.network()
    elsewhere = NetworkSettings(site=f"{net.site}x", connect=net.settings.connect)
    other = net.network(elsewhere)
    told = net.publication()
    until(lambda: names(network) == ["uav_1"], between=saying(told, report()))
    assert other.uavs() == ()


def test_after_a_router_was_started_again_presence_is_right_by_itself(net: ZenohNet) -> None:
    router = net.router()
    network, told = net.network(), net.publication()
    until(lambda: names(network) == ["uav_1"], between=saying(told, report()))
    router.close()
    until(lambda: names(network) == [] and not network.is_connected)
    told.put(report())  # waits for nothing
    net.router()
    until(lambda: names(network) == ["uav_1"])
    assert network.is_connected
    assert told.is_connected


def test_two_daemons_of_one_name_are_reported_and_not_executed(net: ZenohNet) -> None:
    net.router()
    network = net.network()
    for instance, host in ((1, "a"), (2, "b")):
        told = net.publication(instance=instance)
        once = report(uav(address=f"10.0.0.{instance}:50051"), host=host)
        until(lambda: len(names(network)) == instance, between=saying(told, once))  # noqa: B023
    with pytest.raises(InvalidArgumentError, match="2 UAVs have the name uav_1"):
        network.find("uav_1")


def test_what_is_no_report_is_dropped_and_reported(net: ZenohNet) -> None:
    said: list[str] = []
    net.router()
    network, told = net.network(), net.publication()
    network._on_problem = said.append
    until(lambda: names(network) == ["uav_1"], between=saying(told, report()))
    session = told._session
    # One after the other: of what waits together only the newest of each daemon is read.
    sent: list[Callable[[], None]] = [
        lambda: session.put(told._key, b"\xff\xff"),
        lambda: session.put(f"ual/{net.site}/uav_9/nonsense/telemetry", b""),
        lambda: session.put(f"ual/{net.site}/uav_9/00000000000000ff/telemetry", b""),
        lambda: told.put(report(uav("uav_2"))),
    ]
    for count, send in enumerate(sent, 1):
        send()
        until(lambda: len(said) == count, seen=lambda: said)  # noqa: B023
    assert said == [
        "uav_1 sends what is no report (Error parsing message with type 'ual.v1.NetworkReport'): dropped",
        "something was sent under a key that no daemon has: dropped",
        "uav_9 sends what is no report (it tells of a rate of 0.0): dropped",
        "uav_1 tells of uav_2, for which it may not speak: dropped",
    ]
    assert names(network) == ["uav_1"]


def test_on_loopback_they_find_each_other_without_a_router(net: ZenohNet) -> None:
    loopback = NetworkSettings(site=net.site, scouting_port=free_port())
    assert loopback.means is Scouting.LOOPBACK
    network, told = net.network(loopback), net.publication(settings=loopback)
    until(lambda: names(network) == ["uav_1"], between=saying(told, report()))


def test_without_a_router_it_says_where_it_looked(net: ZenohNet) -> None:
    with pytest.raises(DaemonUnreachableError, match=f"no router of the network answers .{net.endpoint}.") as caught:
        discover(net.settings, timeout_s=0.2)
    assert caught.value.reason == "DAEMON_UNREACHABLE"


def test_a_program_that_forgets_to_close_ends(net: ZenohNet) -> None:
    """Without `close` it would wait for Zenoh's threads."""
    net.router()
    program = f"""
from ual.network import Network, NetworkSettings
network = Network(NetworkSettings(site={net.site!r}, connect=({net.endpoint!r},)), timeout_s={LIMIT_S})
print(network.described)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=LIMIT_S)
    assert (done.returncode, done.stdout) == (0, f"site {net.site}, {net.endpoint}\n"), done.stderr


FORKED = """
import os, sys, ual
from ual.network import Network, NetworkSettings
from ual.errors import ClientUnusableError
settings = NetworkSettings(site={site!r}, connect=({endpoint!r},))
network = Network(settings, timeout_s={limit})
assert network.wait_for(lambda it: it.uavs(), {limit})
clients = [ual.Uav("uav_1", network=network), ual.Uav("uav_1", network=settings)]
found = clients[1].address
def refused(call):
    try:
        call()
    except ClientUnusableError as error:
        return "joined before this process was forked" in str(error)
def child():
    assert [each.address for each in clients] == [found, found]
    assert ual.Uav("uav_1", network=settings).address == found
    assert not network.is_connected
    calls = [network.uavs, network.wait_until_complete, lambda: network.find("uav_1"), lambda: Network(settings)]
    calls += [lambda: ual.Uav("uav_9", network=settings).address]
    assert all(refused(each) for each in calls)
    {end}
sys.stdout.flush()
if not os.fork():
    child()
    sys.exit(0)  # with all that an end does
print(os.waitstatus_to_exitcode(os.wait()[1]), flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no fork")
@pytest.mark.parametrize(
    "end",
    ["pass", "network.close(); [each.close() for each in clients]", "globals().update(network=None, clients=None)"],
)
def test_a_forked_child_flies_on_and_ends(net: ZenohNet, end: str) -> None:
    """Zenoh's threads are missing there: whatever waits for them waits forever."""
    net.router()
    told, ended = net.publication(), threading.Event()

    def tell() -> None:
        while not ended.wait(0.02):
            told.put(report())

    telling = threading.Thread(target=tell)
    telling.start()
    program = FORKED.format(site=net.site, endpoint=net.endpoint, limit=LIMIT_S, end=end)
    try:
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=LIMIT_S)
    finally:
        ended.set()
        telling.join()
    assert (done.returncode, done.stdout) == (0, "0\n"), done.stderr


FORKED_AFTERWARDS = """
import os, sys
from ual.network import Network, NetworkSettings
from ual.errors import ClientUnusableError
settings = NetworkSettings(site={site!r}, connect=({endpoint!r},))
Network(settings, timeout_s={limit}).close()
if not os.fork():
    try:
        Network(settings)
    except ClientUnusableError:
        sys.exit(0)
    sys.exit(1)
print(os.waitstatus_to_exitcode(os.wait()[1]), flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no fork")
def test_a_child_of_a_program_that_has_left_the_network_says_that_it_cannot_join(net: ZenohNet) -> None:
    net.router()
    program = FORKED_AFTERWARDS.format(site=net.site, endpoint=net.endpoint, limit=LIMIT_S)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=LIMIT_S)
    assert (done.returncode, done.stdout) == (0, "0\n"), done.stderr
