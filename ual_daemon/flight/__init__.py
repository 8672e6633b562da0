"""Flight of one UAV: the state, tasks and manoeuvres."""
