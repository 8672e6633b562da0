"""Measures how straight and fast UAL's tracker flies, compared with other methods. See benchmarks/tracker.md."""
