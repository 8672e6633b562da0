"""``ual ros2``: UAVs as nodes of ROS 2. docs/clients/ros2.md describes it."""
