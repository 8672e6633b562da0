"""How straight and how fast UAL's tracker flies, beside the ways that it replaces. See benchmarks/tracker.md."""
