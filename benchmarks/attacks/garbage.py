"""Sends garbage to a MAVLink port: ``python -m benchmarks.attacks.garbage magics PORT --rate 0.3``, in MB/s.

It sends from another host's address (127.0.0.2), or by `--descriptor` through the socket of another process, the
autopilot's own, from which it was started.
"""

from __future__ import annotations

import argparse
import random
import socket
from collections.abc import Callable
from contextlib import suppress

from benchmarks.attacks.attacker import Pace, stop_at_end_of_input

_SIZE = 1400
_VARIANTS = 64
STRANGER = "127.0.0.2"


def _random(noise: random.Random) -> bytes:
    return noise.randbytes(_SIZE)


def _magics(_: random.Random) -> bytes:
    """Beginnings of the largest frames."""
    return (b"\xfd\xff\x00" * _SIZE)[:_SIZE]


def _magics_v1(_: random.Random) -> bytes:
    """Beginnings of frames of MAVLink 1."""
    return b"\xfe" * _SIZE


KINDS: dict[str, Callable[[random.Random], bytes]] = {"random": _random, "magics": _magics, "magics_v1": _magics_v1}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.attacks.garbage", description=__doc__)
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument("port", type=int)
    parser.add_argument("--rate", type=float, default=0.3, help="MB/s")
    parser.add_argument("--descriptor", type=int)
    arguments = parser.parse_args()
    if arguments.descriptor is None:
        end = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        end.bind((STRANGER, 0))
    else:
        end = socket.socket(fileno=arguments.descriptor)
    noise = random.Random(1)
    datagrams = [KINDS[arguments.kind](noise) for _ in range(_VARIANTS)]
    stop, pace, count = stop_at_end_of_input(), Pace(arguments.rate * 1e6 / _SIZE), 0
    while not stop.is_set():
        pace.wait()
        with suppress(OSError):
            end.sendto(datagrams[count % _VARIANTS], ("127.0.0.1", arguments.port))
        count += 1
    print(count * _SIZE, flush=True)


if __name__ == "__main__":
    main()
