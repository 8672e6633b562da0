"""Recordings of `ual record` and `ual plot`: written from a client's data; read, drawn and exported."""
