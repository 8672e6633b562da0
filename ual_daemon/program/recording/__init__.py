"""Records what the daemon does: telemetry, calls, setpoints, states, log lines and raw packets, as one MCAP file."""
