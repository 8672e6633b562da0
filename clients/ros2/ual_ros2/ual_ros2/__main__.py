"""``python -m ual_ros2`` and ``ros2 run ual_ros2 node``: the node, or what it lacks."""

from __future__ import annotations

import sys
from importlib.util import find_spec

_NEEDED = {
    "rclpy": "ROS 2. Run `. /opt/ros/jazzy/setup.bash`, with the name of your distribution, in this shell",
    "ual": "the Python client of UAL. Activate the virtual environment in which it is installed, and start it again",
    "ual_msgs": "ual_msgs. Run `. install/setup.bash` in the workspace that has it, or start the node by `ual ros2`",
}


def lacks() -> str:
    """Returns which module this Python does not find, and what to do. Empty: none."""
    missing = next((name for name in _NEEDED if find_spec(name) is None), None)
    return "" if missing is None else f"ual_ros2: {sys.executable} does not find `{missing}` of {_NEEDED[missing]}"


def main() -> None:
    """Runs the node until SIGINT or SIGTERM."""
    if said := lacks():
        sys.exit(said)
    from ual_ros2.node import main as run  # imported late: without what it needs there is a better word than its own

    run()


if __name__ == "__main__":
    main()
