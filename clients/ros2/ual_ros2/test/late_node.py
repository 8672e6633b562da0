"""The node with clocks that a test sets: ``late_node.py FILE --ros-args …``.

The file has by how many seconds all that comes is late. A node that stood still for so long, or a message that DDS kept
for so long, is the same to it.
"""

from __future__ import annotations

import sys
import time
from functools import partial
from pathlib import Path

from ual_ros2 import interface, node
from ual_ros2.lateness import LatenessCheck, ProgramPulse


def main(file: Path, arguments: list[str]) -> None:
    """Runs the node until SIGINT or SIGTERM."""

    def late_s() -> float:
        return float(file.read_text(encoding="utf-8"))

    clocked = {
        "Lateness": partial(LatenessCheck, utc_s=lambda: time.time() + late_s()),
        "Pulse": partial(ProgramPulse, late_s),
    }
    vars(interface).update(clocked)
    node.main(arguments)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
