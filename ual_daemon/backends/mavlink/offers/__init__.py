"""What the mavlink backend offers beside flying: `ual_daemon.backends.offers` by the protocols."""
