"""The daemon on the network (``--network``): that it is there, and a small telemetry. It hears nothing from there."""
