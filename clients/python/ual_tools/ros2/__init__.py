"""``ual ros2``: UAVs as nodes of ROS 2. docs/reference/clients/ros2.md describes it."""
