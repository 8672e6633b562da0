"""The services that are shipped with the daemon, besides that of the UAV: docs/evidence/decisions/0047.

Each is a module here: what the class and its servicer (`ual_daemon.server.services`) have in common, without gRPC.
"""
