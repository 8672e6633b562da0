"""``python -m ual_ros2``: the node, without colcon."""

from ual_ros2.node import main

main()
