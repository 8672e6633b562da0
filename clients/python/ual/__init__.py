"""The UAV abstraction layer: fly any UAV without knowing its autopilot."""
