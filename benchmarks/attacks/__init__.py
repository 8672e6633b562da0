"""Attacks on a daemon on loopback: what a mad or hostile caller does, to measure that a flight does not notice."""
