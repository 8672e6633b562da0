"""From goals to setpoints."""
