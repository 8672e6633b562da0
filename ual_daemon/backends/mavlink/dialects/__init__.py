"""Differences of PX4 and ArduPilot: modes, limits, commands and setpoints of each, with units and axes."""
