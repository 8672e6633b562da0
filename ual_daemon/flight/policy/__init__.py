"""What bounds a flight: fences, authority, the lease, jumps of the estimate."""
