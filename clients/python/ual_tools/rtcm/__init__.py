"""`ual rtcm`: corrections of a base station, out of a serial port, a TCP port or an NTRIP caster, to the UAV."""
