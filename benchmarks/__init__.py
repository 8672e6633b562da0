"""Measures the speed and memory of UAL in comparison with MAVSDK. See README.md; run by ``make bench``."""
