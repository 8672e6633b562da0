"""Services of a UAV in ROS other than flying: gimbals, cameras, equipment, missions, the fence, logs, corrections,
simulation.

`services` and `telling` have the names that ROS sees. All else needs no ROS: requests are known by their fields, and
`filling` puts what is told into messages.
"""
