"""How fast and how small UAL is, beside MAVSDK, in one run. See README.md; run by ``make bench``."""
