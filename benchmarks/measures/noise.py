"""Measures the noise of the machine: the time of a datagram to another process of the same priority and back."""

from __future__ import annotations

import socket
import sys
import time

from benchmarks.children import Process, free_port
from benchmarks.results import Results

_COUNT = 200
_PERIOD_S = 0.005
_ECHO = """
import socket, sys
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as echo:
    echo.bind(("127.0.0.1", int(sys.argv[1])))
    while True:
        echo.sendto(*echo.recvfrom(64))
"""


def measure(results: Results) -> None:
    """Measures one round, in ms. Times above the smallest one come from the machine."""
    port = free_port(socket.SOCK_DGRAM)
    with (
        Process([sys.executable, "-c", _ECHO, str(port)]) as echo,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe,
    ):
        probe.connect(("127.0.0.1", port))
        _until_there(probe)
        echo.prefer()
        took_ms = []
        for _ in range(_COUNT):
            time.sleep(_PERIOD_S)
            began_s = time.monotonic()
            probe.send(b"?")
            probe.recv(64)
            took_ms.append((time.monotonic() - began_s) * 1000.0)
        results.add("noise_ms", "a datagram there and back", took_ms)


def _until_there(probe: socket.socket) -> None:
    probe.settimeout(0.05)
    for _ in range(200):
        try:
            probe.send(b"?")
            probe.recv(64)
        except (ConnectionRefusedError, TimeoutError):
            time.sleep(0.05)
        else:
            probe.settimeout(10.0)
            return
    raise TimeoutError("the echo does not answer")
