"""Services of a UAV in ROS other than flying: gimbals, cameras, equipment, missions, the fence, logs, corrections,
simulation.

`service_table` and `publishing` contain the names of ROS. The other modules need no ROS: requests are known by their
fields, and `filling` fills messages with reports.
"""
