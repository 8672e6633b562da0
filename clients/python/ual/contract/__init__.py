"""The facts of the contract's methods, for all three distributions. It is no interface for programs."""
