"""Services that a backend may offer besides flying, an interface each: see `ual_daemon.backends.base.Backend.offer`."""
