"""UAVs as a ROS 2 node: a client of their daemons, so that a crash of ROS never touches a flight."""
