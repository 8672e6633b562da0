"""The services that are shipped with the daemon, beside that of the UAV: docs/decisions/0047-services-beside-flying.md.

Each is a module here: what the class and its servicer (`ual_daemon.server.shipped`) have in common, without gRPC.
"""
