"""The gRPC server: servicers that unpack, call the vehicle and pack; their dispatch; and the transports below."""
