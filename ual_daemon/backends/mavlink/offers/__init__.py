"""Services of the mavlink backend besides flying: `ual_daemon.backends.offers` by the protocols."""
