"""What the UAV flies: the state, tasks and manoeuvres."""
