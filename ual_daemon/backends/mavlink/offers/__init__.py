"""Services of the mavlink backend beside flying: `ual_daemon.backends.offers` by the protocols."""
