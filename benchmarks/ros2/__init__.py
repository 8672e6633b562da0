"""Measures the node of ROS 2: how late a setpoint is through it, and what it costs."""
