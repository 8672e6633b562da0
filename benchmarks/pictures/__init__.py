"""What pictures cost a flight: ``python -m benchmarks.pictures``."""
