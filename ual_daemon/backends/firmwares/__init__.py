"""Firmwares PX4 and ArduPilot, whatever protocol reaches them: for all backends that fly them."""
