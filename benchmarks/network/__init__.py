"""Measures the network: presence, what a flight notices of it, and the wire alone."""
