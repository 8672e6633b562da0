"""Services that a backend may offer beside flying, an interface each: see `ual_daemon.backends.base.Backend.offer`."""
