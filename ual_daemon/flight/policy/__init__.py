"""Bounds of a flight: fences, authority, the lease, jumps of the estimate."""
