"""Options of a transport for the listening sockets of a whole fleet at once."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from ual_daemon.server.transport import listening
from ual_daemon.server.transport.listening import Deferral


@pytest.mark.skipif(not hasattr(socket, "TCP_DEFER_ACCEPT"), reason="the system does not hold connections back")
def test_the_open_files_are_looked_at_once_for_all_ports(monkeypatch: pytest.MonkeyPatch) -> None:
    looks: list[int] = []
    look = listening._sockets

    def counted() -> Iterator[int]:
        looks.append(1)
        return look()

    monkeypatch.setattr(listening, "_sockets", counted)
    deferral = Deferral()
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.create_server(("127.0.0.1", 0))) for _ in range(20)]
        for each in sockets[1:]:
            deferral.add("127.0.0.1:0", each.getsockname()[1])
        deferral.add("unix:/tmp/uav_1.sock", 1)
        for _ in sockets:
            deferral.apply()
        waits = [each.getsockopt(socket.IPPROTO_TCP, socket.TCP_DEFER_ACCEPT) for each in sockets]
    assert len(looks) == 1
    assert waits[0] == 0  # it was not added
    assert min(waits[1:]) > 0
