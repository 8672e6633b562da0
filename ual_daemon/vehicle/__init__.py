"""What may be commanded, and what is told."""
