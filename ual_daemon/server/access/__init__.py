"""Identity of callers, and what each may do: docs/evidence/security.md."""
