"""Who calls, and what the caller may do: docs/security.md."""
