"""What the contract says of its methods, for all three distributions. It is no interface for programs."""
