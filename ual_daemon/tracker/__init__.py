"""From goals to setpoints: the references that lead a UAV along a trajectory, or to a goal that moves."""
