"""The ways to gRPC."""
