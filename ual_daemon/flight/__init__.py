"""What is flown: the state, tasks and manoeuvres."""
