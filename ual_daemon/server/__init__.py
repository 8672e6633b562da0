"""The gRPC server: servicers that unpack, call the vehicle and pack, and what is the same for all calls."""
