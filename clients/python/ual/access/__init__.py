"""Rights of callers: roles, tokens and certificates. The daemon and the ``ual`` command use the same files."""
