"""The exchange with one autopilot over time: its telemetry, our requests and commands, and the state of the link."""
