"""Measures the network: ``python -m benchmarks.network [--only presence|failover|flight|wire] [--uavs 1000]``.

- presence: A fleet in five daemons, each in a network namespace of its own, and two routers with certificates.
- failover: The same, of 500 UAVs that know both routers, the first of which is killed: what a program that starts sees.
- flight: How late setpoints at 50 Hz are: without the network, with it, without its router, and beside nonsense.
- wire: 10,000 UAVs that twenty processes tell of, from recorded telemetry, over one router.

Exit status 1 where something is missed. Namespaces need root and ``ip`` (iproute2).
"""

from __future__ import annotations

import argparse
import sys

from benchmarks.children import prefer_this
from benchmarks.network import flight, presence, wire
from benchmarks.network.goals import NetworkFigure

PARTS = ("presence", "failover", "flight", "wire")


def main() -> int:
    """Returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.network", description=__doc__)
    parser.add_argument("--only", choices=PARTS, action="append", help="may be given again")
    parser.add_argument("--uavs", type=int, default=1000, help="of presence, in all")
    parser.add_argument("--told", type=int, default=10_000, help="of wire, in all")
    parser.add_argument("--messages", type=int, default=100_000, help="of nonsense")
    parser.add_argument("--seconds", type=float, default=10.0, help="of each measurement")
    arguments = parser.parse_args()
    prefer_this()
    found: list[NetworkFigure] = []
    for part in arguments.only or PARTS:
        if part == "presence":
            found += presence.measure(arguments.uavs, arguments.seconds)
        elif part == "failover":
            found += presence.measure_failover(arguments.uavs // 2)
        elif part == "flight":
            found += flight.measure(arguments.messages, arguments.seconds)
        else:
            found += wire.measure(arguments.told, arguments.seconds)
    print()
    for each in found:
        print(each.row())
    return int(not all(each.is_reached for each in found))


if __name__ == "__main__":
    sys.exit(main())
