"""The UAV abstraction layer's daemon and its class interface."""
