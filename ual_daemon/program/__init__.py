"""The program ``ual-daemon``: its configuration, its start, its end."""
