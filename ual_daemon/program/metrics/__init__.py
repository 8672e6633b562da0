"""Metrics (``--metrics``): what is measured of the daemon and its UAVs, for Prometheus."""
