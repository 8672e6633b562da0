"""Who calls, and what the caller may do: docs/evidence/security.md."""
