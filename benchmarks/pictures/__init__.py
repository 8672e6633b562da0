"""Cost of pictures for a flight: ``python -m benchmarks.pictures``."""
