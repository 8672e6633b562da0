"""Recordings: MCAP files of flights, written by ``ual-daemon --record`` and ``ual record``, and read by ``ual record``.

``docs/how-to/record.md`` lists what is in them. Needs the extra ``record``, which is imported only when it is used.
"""
