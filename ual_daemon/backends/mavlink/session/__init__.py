"""The conversation with one autopilot."""
