"""Values and errors from and to what crosses gRPC. The client and the daemon share it; programs need `ual.types`."""
