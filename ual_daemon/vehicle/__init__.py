"""One UAV above its backend: what may be commanded, and what is reported."""
