"""Connections of Zenoh end once no answer comes any more, and connections of others are left alone."""

from __future__ import annotations

import json
import os
import socket
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from tests.ports import free_port
from tests.ual.network.samples import report
from tests.ual.network.zenoh_net import ZenohNet, saying
from tests.waiting import until
from ual.network import configuration, lost_links
from ual.network.session import RouterSession

pytest.importorskip("zenoh", reason="ZENOH IS MISSING, the network is NOT TESTED: pip install 'ual-client[network]'")

OPTION = lost_links.option()
pytestmark = pytest.mark.skipif(OPTION is None, reason="this system has no TCP_USER_TIMEOUT")


def limits(endpoint: str, *, of_the_router: bool = False) -> list[int]:
    """After how many ms without an answer each connection of this process to a router ends; 0 is the system's time."""
    assert OPTION is not None
    found = []
    for connection in lost_links.own_sockets():
        with closing(connection):
            ends = _ports(connection)
            if int(endpoint.rpartition(":")[2]) == ends[0 if of_the_router else 1]:
                found.append(connection.getsockopt(socket.IPPROTO_TCP, OPTION))
    return found


def _ports(connection: socket.socket) -> tuple[int, int]:
    try:
        return connection.getsockname()[1], connection.getpeername()[1]
    except (OSError, IndexError):
        return 0, 0


@pytest.fixture
def router(net: ZenohNet, tmp_path: Path) -> Iterator[RouterSession]:
    file = tmp_path / "router.json5"
    file.write_text(json.dumps(configuration.router(net.settings, listen=[net.endpoint])))
    with RouterSession(file) as running:
        yield running


def test_who_tells_and_who_listens_wait_no_longer_than_the_lease(net: ZenohNet) -> None:
    net.router()
    told = net.publication()
    assert limits(net.endpoint) == [0]
    told.put(report())
    assert limits(net.endpoint) == [configuration.LEASE_MS]
    net.network()
    until(lambda: limits(net.endpoint) == [configuration.LEASE_MS] * 2, seen=lambda: limits(net.endpoint))


def test_a_connection_that_is_made_anew_does_not_either(net: ZenohNet) -> None:
    first = net.router()
    told = net.publication()
    told.put(report())
    first.close()
    until(lambda: not told.is_connected)
    net.router()
    until(lambda: limits(net.endpoint) == [configuration.LEASE_MS], between=saying(told, report()))


def test_a_router_does_not_either(net: ZenohNet, router: RouterSession) -> None:
    net.publication()
    assert limits(net.endpoint, of_the_router=True) == [0]
    until(lambda: limits(net.endpoint, of_the_router=True) == [configuration.LEASE_MS], between=router.keep_links)


def test_connections_of_others_are_left_alone(net: ZenohNet) -> None:
    net.router()
    other = f"tcp/127.0.0.1:{free_port()}"
    with ExitStack() as stack:
        listening = stack.enter_context(closing(socket.create_server(("127.0.0.1", int(other.rpartition(":")[2])))))
        stack.enter_context(closing(socket.create_connection(listening.getsockname())))
        net.publication().put(report())
        assert limits(net.endpoint) == [configuration.LEASE_MS]
        assert limits(other) == [0]


def test_a_socket_that_waits_goes_on_to_wait() -> None:
    """Python makes each socket that it sees a socket that does not wait, where a program has set a time for all
    sockets.
    """
    here, there = socket.socketpair()
    with here, there:
        socket.setdefaulttimeout(1.0)
        try:
            for each in lost_links.own_sockets():
                each.close()
        finally:
            socket.setdefaulttimeout(None)
        assert os.get_blocking(here.fileno())


@pytest.mark.parametrize(
    ("locator", "ends"),
    [
        ("tcp/10.0.0.1:7447", ("10.0.0.1", 7447)),
        ("tls/[fe80::1]:7447", ("fe80::1", 7447)),
        ("tls/10.0.0.1:7447?a=b#c", ("10.0.0.1", 7447)),
        ("quic/10.0.0.1:7447", None),
        ("udp/10.0.0.1:7447", None),
    ],
)
def test_only_tcp_has_this_option(locator: str, ends: object) -> None:
    assert lost_links.end_of(locator) == ends
