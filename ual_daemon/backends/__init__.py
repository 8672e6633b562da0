"""Backends: one module or sub-package per autopilot, each behind `ual_daemon.backends.base.Backend`."""
